"""Hooks of MkDocs that add content from armgap to the documentation site: effect library, commands, and pages outside of docs/.

A page of docs/effects describes an effect in words; its equation, parameters, bounds, picture and the fields of simulators are taken
from the program when the site is built, so that they cannot differ from it.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import click
import site_pictures
from click.testing import CliRunner
from mkdocs.structure.files import File, Files

from armgap import effects
from armgap.cli import COMMANDS, cli
from armgap.export.fields import FIELDS, Field

ROOT = Path(__file__).resolve().parents[1]
MARKER = "<!-- catalogue -->"
FAMILIES = {
    "Friction": (
        "coulomb_asymmetry",
        "stribeck",
        "quadratic_drag",
        "cubic_drag",
        "load_dependent_friction",
        "position_dependent_friction",
        "friction_warmup",
        "presliding",
        "viscous_asymmetry",
        "cross_friction",
        "gear_efficiency",
    ),
    "Drive": (
        "torque_offset",
        "torque_gain",
        "torque_saturation",
        "torque_dead_zone",
        "torque_ripple",
        "actuator_lag",
        "actuator_delay",
    ),
    "Structure": (
        "payload",
        "rotor_inertia",
        "rotor_coupling",
        "joint_spring",
        "hardening_spring",
        "joint_elasticity",
        "backlash",
        "base_tilt",
    ),
    "Sensor": ("encoder_offset", "encoder_eccentricity"),
    "Surroundings": ("contact", "external_pulse"),
}
#: Pages that lie in the root of the repository: name on the site, and file.
OUTSIDE = {"architecture.md": "ARCHITECTURE.md", "contributing.md": "CONTRIBUTING.md", "changelog.md": "CHANGELOG.md"}


def catalogue() -> dict[str, dict[str, Any]]:
    """Return the entries of the effect library by name of the effect."""
    return {entry["name"]: entry for entry in effects()}


def on_config(config: Any) -> Any:
    """Return MkDocs' configuration with a complete navigation: effects by family, decisions, and all pages that it does not list."""
    docs = Path(config["docs_dir"])
    known = catalogue()
    filled = []
    for entry in config["nav"]:
        [(title, content)] = entry.items()
        if title == "Effects":
            families = [
                {f: [{_title(known[n]): f"effects/{n}.md"} for n in names if n in known]}
                for f, names in FAMILIES.items()
            ]
            content = ["effects/index.md", *families]
        elif title == "Decisions":
            content = [f"decisions/{p.name}" for p in sorted((docs / "decisions").glob("*.md"))]
        elif isinstance(content, list):
            content = [item for item in content if _exists(docs, item)]
        filled.append({title: content})
    listed = set(re.findall(r"'([^']+\.md)'", str(filled)))
    further = sorted(p.name for p in docs.glob("*.md") if p.name not in listed)
    config["nav"] = filled + ([{"Further": further}] if further else [])
    return config


def _title(entry: dict[str, Any]) -> str:
    return str(entry["title"])[0].upper() + str(entry["title"])[1:]


def _exists(docs: Path, item: Any) -> bool:
    path = next(iter(item.values())) if isinstance(item, dict) else item
    return path in OUTSIDE or path == "reference/commands.md" or (docs / path).exists()


def on_files(files: Files, config: Any) -> Files:
    """Return the site's files with those made at build time, and without pages of effects that the program does not have."""
    known = catalogue()
    for file in list(files):
        path = Path(file.src_uri)
        if path.parent == Path("effects") and path.stem not in (*known, "index"):
            files.remove(file)
    for name in known:
        files.append(File.generated(config, f"effects/{name}.svg", content=site_pictures.draw(name)))
    for target, source in OUTSIDE.items():
        files.append(File.generated(config, target, content=(ROOT / source).read_text(encoding="utf-8")))
    files.append(File.generated(config, "reference/commands.md", content=commands()))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Return a page's Markdown with content from the effect library, and with repaired links to files outside of docs/."""
    path = Path(page.file.src_uri)
    if path.parent == Path("effects"):
        filled = overview() if path.stem == "index" else facts(path.stem)
        markdown = markdown.replace(MARKER, filled)
    if path.stem == "method":
        markdown = markdown.replace("<!-- thresholds -->", thresholds()).replace("<!-- figures -->", figures())
    return mended(markdown, str(path))


def mended(markdown: str, path: str) -> str:
    """Return Markdown with links between the repository's root and docs/ changed to those of the site; other local links become text."""
    pages = {source: target for target, source in OUTSIDE.items()}
    known = catalogue()

    def link(match: re.Match[str]) -> str:
        text, target = match.groups()
        bare = target.split("#")[0]
        if path in OUTSIDE:
            inside = bare.removeprefix("docs/")
            return f"[{text}]({inside})" if inside != bare and (ROOT / bare).is_file() else pages_or_text(text, bare)
        if bare.startswith("../") and (ROOT / "docs" / Path(path).parent / bare).resolve().parent == ROOT:
            return pages_or_text(text, Path(bare).name, "../" * (len(Path(path).parts) - 1))
        if (
            "effects/" in f"{Path(path).parent / bare}"
            and Path(bare).suffix == ".md"
            and Path(bare).stem not in (*known, "index")
        ):
            leads_home = Path(bare).parts[:1] == ("..",)
            return match.group(0) if leads_home and "effects" not in bare else text
        outside = not (ROOT / "docs" / Path(path).parent / bare).resolve().is_relative_to(ROOT / "docs")
        return text if outside else match.group(0)

    def pages_or_text(text: str, name: str, up: str = "") -> str:
        return f"[{text}]({up}{pages[name]})" if name in pages else text

    return re.sub(r"(?<!!)\[([^\]]+)\]\((?!https?:|#)([^)]+)\)", link, markdown)


def figures() -> str:
    """Return a Markdown list of links to the pages of scores and benchmarks that exist."""
    pages = {"trial-scores.md": "Scores of the blind trials, beside other methods", "benchmarks.md": "Costs, measured"}
    return "\n".join(f"* [{title}]({page})." for page, title in pages.items() if (ROOT / "docs" / page).is_file())


def thresholds() -> str:
    """Return a Markdown table of the constants that decide about effects, with their comments."""
    files = ("search/acceptance.rs", "likelihood/holdout.rs")
    source = "\n".join((ROOT / "rust" / "fit" / "src" / file).read_text(encoding="utf-8") for file in files)
    found = re.findall(r"^/// ([^\n]+)\n(?:pub )?const (\w+): \w+ = ([^;]+);", source, re.MULTILINE)
    return "\n".join(
        ["| constant | value | what |", "| --- | --- | --- |", *(f"| `{n}` | {v} | {text} |" for text, n, v in found)]
    )


def overview() -> str:
    """Return Markdown tables of all effects, one per family."""
    known = catalogue()
    parts = []
    for family, names in FAMILIES.items():
        rows = [
            f"| [{_title(known[n])}]({n}.md)<br>`{n}` | {_code(known[n]['equation'])} | {known[n]['excited_by']} |"
            for n in names
            if n in known
        ]
        parts += [f"\n## {family}\n", "| effect | equation | excited by |", "| --- | --- | --- |", *rows]
    return "\n".join(parts)


def facts(name: str) -> str:
    """Return equation, picture, parameters and simulators' fields of an effect as Markdown."""
    entry = catalogue()[name]
    where = "one joint" if entry["scope"] == "joint" else "the arm as a whole"
    lines = [
        f"| name | `{name}` |",
        "| --- | --- |",
        f"| sits on | {where} |",
        f"| equation | {_code(entry['equation'])} |",
        f"| source | {entry['source']} |",
        f"| excited by | {entry['excited_by']} |",
        "",
        f"![{_title(entry)}: position with and without it, and the residual torque]({name}.svg)",
        "",
        f"*{_bench(name)} with {_sizes(name)}. {_reading(name)}*",
        "",
        "| parameter | unit (linear joint) | bounds | without the effect |",
        "| --- | --- | --- | --- |",
        *(_parameter(p, first=i == 0) for i, p in enumerate(entry["parameters"])),
        "",
        *_fields(name),
    ]
    return "\n".join(lines)


def _code(text: str) -> str:
    return f"`{text}`"


def _bench(name: str) -> str:
    return (
        "A bench pendulum" if site_pictures.SIGNATURES[name].kind == "pendulum" else "Joint 1 of a small two-link arm"
    )


def _sizes(name: str) -> str:
    [shown] = site_pictures.placed(name)
    units = {p["name"]: p["unit"] for p in catalogue()[name]["parameters"]}
    return ", ".join(
        f"{key} = {value:g}" + ("" if units[key] == "1" else f" {units[key]}")
        for key, value in shown.parameters.items()
    )


def _reading(name: str) -> str:
    against = site_pictures.AXES[site_pictures.SIGNATURES[name].against].rpartition(" [")[0]
    return f"Left: positions under the same torques. Right: the residual torque of the nominal model, over {against}."


def _parameter(p: dict[str, Any], *, first: bool) -> str:
    unit = p["unit"] if p["unit"] == p["unit_linear"] else f"{p['unit']} ({p['unit_linear']})"
    neutral = "never reached" if p["neutral"] >= 1e8 else f"{p['neutral']:g}"
    return f"| `{p['name']}` | {unit} | {_bounds(p['lower'], p['upper'])} | {neutral if first else ''} |"


def _bounds(lower: float, upper: float) -> str:
    if math.isinf(lower) and math.isinf(upper):
        return "any"
    if math.isinf(upper):
        return f"{lower:g} or more"
    return f"{lower:g} to {upper:g}"


def _fields(name: str) -> list[str]:
    field = FIELDS.get(name, Field())
    sizes = site_pictures.placed(name)[0]
    pairs = ",".join(f"{k}={v:g}" for k, v in sizes.parameters.items())
    joint = "" if sizes.joint is None else sizes.joint
    rows = [("MJCF", field.mjcf), ("URDF", field.urdf), ("arm file", field.toml)]
    known = "; ".join(f"{form}: {_code(where)}" for form, where in rows if where)
    return [
        f"**In a simulator.** {known or 'No field in MJCF, URDF or an arm file'}{'. It is ' + field.short if field.short else ''}.",
        "",
        f"**Try it.** `armgap simulate --arm arm.toml --torque log.parquet --effect {name}:{joint}:{pairs} -o with.parquet`",
    ]


def commands() -> str:
    """Return the help texts of all commands as Markdown, with sub-commands below their groups."""
    lead = "`armgap COMMAND --help` prints these texts. Exit status: 0 done, 2 unusable input, 130 interrupted.\n"
    context = cli.make_context("armgap", [], resilient_parsing=True)
    return "\n".join(["# Commands\n", lead, *(line for name in COMMANDS for line in _help(cli, context, (name,)))])


def _help(group: click.Group, context: click.Context, words: tuple[str, ...]) -> list[str]:
    shown = CliRunner().invoke(cli, [*words, "--help"], prog_name="armgap", terminal_width=100)
    lines = [f"{'#' * (len(words) + 1)} {' '.join(words)}\n", "```text", shown.output.rstrip(), "```\n"]
    command = group.get_command(context, words[-1])
    below = sorted(n for n, c in command.commands.items() if not c.hidden) if isinstance(command, click.Group) else []
    return lines + [line for name in below for line in _help(command, context, (*words, name))]  # type: ignore[arg-type]
