"""Command that writes a page from recorded answers: ``python -m tests.input_defects.score FILE… [-o PAGE.md]``."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from .answering import WHOLE, spoilt
from .defects import DEFECTS, REPAIRED
from .floors import floor_section
from .judging import Judged, Record, checks, first_right, judged
from .making import read
from .tables import percent, table

INTRODUCTION = """\
# Defects of the input

Cases of the blind trials' generator, spoilt in one known way at a time and diagnosed as a user would: files in, answer out. What the
answer has to say is written beside each defect, by code that shares nothing with the checks (`tests/input_defects`)."""

RULES = """\
*Right*: a check of the defect's name, or of one that no log tells from it, with the severity it should have (and the row, of single
rows and stretches), and no check of another name that stops or repairs. *All remedies*: right, and every remedy of its class is
offered, numbers within 10 %. *No wrong effect*: no effect has a probability of 0.5 or more that is neither hidden in the case, nor
alike, nor says itself that it may be the hidden one. *Other remedies*: answers that offer a remedy which is none. *Left out*: the
arm does not have the defect, or the hidden effect is of its kind."""


def main(words: list[str] | None = None) -> None:
    """Read the records of answers and write the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.input_defects.score", description=__doc__)
    parser.add_argument("records", nargs="+", type=Path, metavar="JSONL")
    parser.add_argument("-o", "--output", type=Path, metavar="MD", help="the page; on standard output by default")
    parser.add_argument("--cache", type=Path, metavar="DIR", help="of the run: judge by the catalogue as it is now")
    options = parser.parse_args(words)
    records = load(options.records)
    text = page(expected_now(records, options.cache) if options.cache else records)
    if options.output is None:
        print(text, end="")
    else:
        options.output.write_text(text, encoding="utf-8")


def load(paths: Iterable[Path]) -> list[Record]:
    """Return all records of the files; of several answers to one question the last."""
    lines = [line for path in paths for line in path.read_text(encoding="utf-8").splitlines()]
    records = [json.loads(line) for line in lines]
    return list({(r["mode"], r["seed"], r["case"], r["defect"]): r for r in records}.values())


def expected_now(records: list[Record], cache: Path) -> list[Record]:
    """Return the records with what the catalogue expects now in place of what it expected when they were made."""
    return [
        {**r, "expected": spoilt(read(cache / r["case"]), r["defect"], r["seed"])[1].to_dict()}
        if "expected" in r
        else r
        for r in records
    ]


def page(records: list[Record]) -> str:
    """Return the page as Markdown, with a section for every mode that was run."""
    parts = [INTRODUCTION, _made(records)]
    for mode, section in SECTIONS.items():
        of_mode = [r for r in records if r["mode"] in READ_FROM.get(mode, (mode,))]
        if of_mode:
            parts.append(section(of_mode))
    parts += [schema_section(records)] if any("schema" in r for r in records) else []
    return "\n\n".join(parts) + "\n"


def schema_section(records: list[Record]) -> str:
    """Return the section on how many diagnoses fit their JSON Schema and are unchanged when read and written again."""
    asked = [r for r in records if "schema" in r]
    wrong = [[r["case"], r["defect"], "; ".join(r["schema"])] for r in asked if r["schema"]]
    text = f"{len(asked) - len(wrong)} of {len(asked)} diagnoses are as the JSON schema says, and the same text after reading and writing."
    return "\n\n".join(["## Schema", text] + ([table(["case", "defect", "what differs"], wrong)] if wrong else []))


def _made(records: list[Record]) -> str:
    versions = sorted({r["version"] for r in records if "version" in r})
    runs = sorted({(r["mode"], r["seed"]) for r in records})
    said = ", ".join(f"{mode} with seed {seed}" for mode, seed in runs)
    return f"armgap {', '.join(versions)}; {said}. The commands stand at the top of `tests/input_defects/__init__.py`."


@dataclass(frozen=True)
class Row:
    """Record of one case with a defect, and its judgement, or None where there is no answer."""

    record: Record
    judged: Judged | None


def defects_section(records: list[Record]) -> str:
    """Return the section on which defects are found, with which remedies, and what is wrongly named in spite of them."""
    rows = [Row(r, None if "failed" in r else judged(r)) for r in records if "skipped" not in r]
    left_out = Counter(r["defect"] for r in records if "skipped" in r)
    head = ["defect", "cases", "right", "all remedies", "no wrong effect", "other remedies", "left out"]
    lines = [_line(name, [x for x in rows if x.record["defect"] == name], left_out[name]) for name in DEFECTS]
    by_defect = table(head, [line for line in lines if line[1] != "0"])
    groups = {"all": rows, **_groups(rows)}
    total = table([*head[:1], *head[1:-1]], [_line(name, of, 0)[:-1] for name, of in groups.items()])
    parts = [
        "## Defects named",
        total.replace("| defect ", "| cases of ", 1),
        RULES,
        by_defect,
        _wrong(rows),
        _failed(records),
    ]
    return "\n\n".join(part for part in parts if part)


def _groups(rows: list[Row]) -> dict[str, list[Row]]:
    models = dict.fromkeys(x.record["model"] for x in rows)
    groups = {model: [x for x in rows if x.record["model"] == model] for model in models}
    groups["with a hidden effect"] = [x for x in rows if x.record["hidden"]]
    groups["without"] = [x for x in rows if not x.record["hidden"]]
    return groups


def _line(name: str, rows: Sequence[Row], left_out: int) -> list[str]:
    results = [x.judged for x in rows if x.judged is not None]
    right, complete, strange = (sum(getattr(r, key) for r in results) for key in ("right", "complete", "strange"))
    harmless = len(rows) - sum(bool(r.wrong) for r in results)
    shares = [percent(count, len(rows)) for count in (right, complete, harmless)]
    return [name, str(len(rows)), *shares, str(strange), str(left_out)]


def _wrong(rows: list[Row]) -> str:
    """Return a list of every answer that is not right or not complete."""
    lines = []
    for x in rows:
        if x.judged is None or (x.judged.complete and not x.judged.wrong):
            continue
        r = x.record
        said = ", ".join(f"{c['check']} ({c['severity']}) {c['remedy'] or ''}".strip() for c in checks(r)) or "no check"
        hidden = ", ".join(f"{effect}:{joint or ''}" for effect, joint in r["hidden"]) or "nothing"
        wrong = ", ".join(x.judged.wrong) or "-"
        lines.append([r["defect"], r["case"], hidden, r["verdict"], said.replace("|", "/"), wrong])
    if not lines:
        return ""
    return "### Answers that are not right in full\n\n" + table(
        ["defect", "case", "hidden", "verdict", "checks", "wrong effects"], lines
    )


def _failed(records: list[Record]) -> str:
    failed = [r for r in records if "failed" in r]
    if not failed:
        return ""
    lines = [[r["defect"], r["case"], r["failed"].replace("|", "/")] for r in failed]
    return "### Without an answer\n\nCounted as not right, and as naming nothing.\n\n" + table(
        ["defect", "case", "why"], lines
    )


def clean_section(records: list[Record]) -> str:
    """Return the section on checks that fire on cases without a defect."""
    answered = [r for r in records if "failed" not in r]
    fired = [(c["severity"], c["check"], r) for r in answered for c in checks(r)]
    totals = {
        s: len({r["case"] for severity, _, r in fired if severity == s}) for s in ("error", "repaired", "warning")
    }
    total = table(
        ["cases", *totals, "without an answer"],
        [[str(len(records)), *map(str, totals.values()), str(len(records) - len(answered))]],
    )
    lines = [
        [severity, check, r["case"], ", ".join(f"{e}:{j or ''}" for e, j in r["hidden"]) or "nothing"]
        for severity, check, r in fired
    ]
    noisy = sum(bool(r.get("noise_counts")) for r in records)
    text = f"## Silence\n\nCases of a blind trial as they are, {noisy} of {len(records)} with white noise beside the encoder's rounding; cases in\n"
    text += f"which a check of each severity fires.\n\n{total}"
    return text + ("\n\n" + table(["severity", "check", "case", "hidden"], lines) if lines else "")


def repaired_section(records: list[Record]) -> str:
    """Return the section that compares diagnoses of repaired inputs with diagnoses of the same cases without the defect."""
    whole = {(r["seed"], r["case"]): r for r in records if r["defect"] == WHOLE}
    lines = []
    for name, variants in REPAIRED.items():
        asked = [r for r in records if r["defect"] in variants]
        kept = [r for r in asked if "skipped" not in r and ("failed" in r or not destroyed(r))]
        pairs = [(r, whole[r["seed"], r["case"]]) for r in kept if (r["seed"], r["case"]) in whole]
        with_it = sum("failed" not in r and first_right(r) for r, _ in pairs)
        without = sum("failed" not in w and first_right(w) for _, w in pairs)
        points = f"{100 * (with_it - without) / len(pairs):+.1f}" if pairs else "-"
        row = [name, str(len(pairs)), percent(without, len(pairs)), percent(with_it, len(pairs)), points]
        lines.append([*row, str(len(asked) - len(kept))])
    head = ["defect", "cases", "first cause right without", "with", "points", "left out"]
    text = "Cases of a blind trial without and with a defect that is repaired; right is no cause where none is hidden. Left out: the\n"
    text += "defect does not exist on the arm, or it equals or destroys the hidden effect."
    return f"## Repaired\n\n{text}\n\n{table(head, lines)}"


def destroyed(record: Record) -> bool:
    """Return whether held samples hide a hidden effect completely, because it is shorter than the time for which a sample is held."""
    if not record["defect"].startswith("repeated_positions:"):
        return False
    time = int(record["defect"].partition(":")[2]) * record["period"]
    return any(_lasts(h["effect"], h["parameters"]) < time for h in record["sizes"])


def _lasts(effect: str, parameters: dict[str, float]) -> float:
    """Return the time scale of an effect [s]: of an elastic joint a quarter of its period, infinite for an effect without a time scale."""
    if effect == "joint_elasticity":
        return 0.25 * 6.283 * float((parameters["rotor_inertia"] / parameters["stiffness"]) ** 0.5)
    times = {"actuator_delay": "delay", "actuator_lag": "time_constant", "external_pulse": "duration"}
    return parameters[times[effect]] if effect in times else float("inf")


SECTIONS: dict[str, Callable[[list[Record]], str]] = {
    "defects": defects_section,
    "repaired": repaired_section,
    "clean": clean_section,
    "floor": floor_section,
}

#: Modes whose records a section uses: the cases of mode ``floor`` have no defect either, so that checks that fire on them count too.
READ_FROM = {"clean": ("clean", "floor")}


if __name__ == "__main__":
    main()
