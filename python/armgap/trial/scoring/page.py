"""Figures of a trial as a Markdown page: cases and scores, by method and by hidden effect."""

from __future__ import annotations

from collections.abc import Sequence

from armgap.trial.cases.making import Manifest
from armgap.trial.cases.visibility import MULTIPLE, VISIBLE_SIGMAS
from armgap.trial.effects.base import REGISTRY
from armgap.trial.methods import methods
from armgap.trial.scoring.case_score import GROUPS
from armgap.trial.scoring.figures import CONFIDENT, Figures, Share, share
from armgap.trial.trial import DEVELOPMENT_SEEDS

__all__ = ["page"]


def page(all_figures: Sequence[Figures], manifest: Manifest | None, seal: str) -> str:
    """Return the figures of a trial as a Markdown page.

    Parameters
    ----------
    all_figures : sequence of Figures
        Figures of all methods, armgap first.
    manifest : Manifest, optional
        Manifest of the cases.
    seal : str
        SHA-256 over the seals of all cases.

    Returns
    -------
    str
        Markdown.
    """
    first = all_figures[0]
    parts = [
        _head(first, manifest, seal),
        _summary(all_figures),
        _groups(all_figures),
        _effects(all_figures),
        _bands(all_figures),
        _machines(first),
        _calibration(first),
        _sizes(first),
        _wrong(first),
        _method(all_figures),
    ]
    return "\n\n".join(part.strip() for part in parts if part) + "\n"


def _head(first: Figures, manifest: Manifest | None, seal: str) -> str:
    n = len(first.cases)
    made = "It was made from cases whose origin is not stated."
    if manifest is not None:
        made = (
            f"It is the output of `armgap trial all -n {manifest.cases} --seed {manifest.seed} -o DIR --md` "
            f"with armgap {first.version} and {manifest.engine}; logs of {manifest.duration:g} s."
        )
        if manifest.seed in DEVELOPMENT_SEEDS:
            made += " armgap was developed on cases of this seed: its scores flatter; a fresh seed is the test."
    return f"""# Scores of a blind trial

{n} cases made by MuJoCo, an engine that is not armgap's. Each hides something in an arm with other values than its arm
file says, moved by torques in open loop or by a controller, seen through encoders. Methods get the arm file and the logs.
The keys are sealed: their hashes stand in the arm files, and one hash over all of them is `{seal[:16]}`.

{made} The same command makes the same cases and the same table; another seed makes a trial that nobody has seen."""


def _summary(all_figures: Sequence[Figures]) -> str:
    rows = [_summary_row(f) for f in all_figures]
    head = (
        "method",
        "cause and joint right",
        "false alarms",
        "named wrongly with p ≥ 0.9",
        "extra causes per case",
        "CPU s per case",
    )
    return (
        "## In one table\n\n"
        + table(head, rows)
        + f"""

*Cause and joint right*: of the cases with visible effects of the library, the first cause named is a hidden one on its
joint, or an equivalent that no log of motion tells from it; in brackets the 95 % interval. *False alarms*: any cause named
where there is none, with the arm file's values right or wrong. *Named wrongly*: of all causes named with a probability of
{CONFIDENT} or more, in all cases, those that are not there. *Extra*: causes named that are not there, per case.{_partial(all_figures)}"""
    )


def _partial(all_figures: Sequence[Figures]) -> str:
    """Return lines with the scores of methods that cannot express all effects, on the cases that they can express."""
    lines = []
    for f in all_figures:
        can = methods()[f.method].expresses
        if can is None:
            continue
        asked = {c.case for c in f.visible if all(effect in can for effect, _ in c.hidden)}
        theirs, ours = (share([c for c in x.visible if c.case in asked]) for x in (f, all_figures[0]))
        title = methods()[f.method].title
        lines.append(
            f"\n\n{title} has parameters for {len(can)} of the effects only. In the cases that hide nothing else it is right in "
            f"{_plain(theirs)}, armgap in {_plain(ours)}."
        )
    return "".join(lines)


def _summary_row(f: Figures) -> tuple[str, ...]:
    quiet = sum(bool(c.named) for c in f.quiet)
    sure = f.confident
    return (
        methods()[f.method].title,
        _percent(f.headline),
        f"{quiet} of {len(f.quiet)}",
        f"{sure.of - sure.right} of {sure.of}",
        f"{f.extra:.2f}",
        f"{f.seconds[0]:.2f}",
    )


def _groups(all_figures: Sequence[Figures]) -> str:
    shares = [f.by_group for f in all_figures]
    rows = [(g, GROUPS[g], *(_plain(s.get(g)) for s in shares)) for g in GROUPS if any(g in s for s in shares)]
    outside = [c for c in all_figures[0].cases if c.group == "outside the library"]
    unexplained = sum(c.verdict == "unexplained" for c in outside)
    believed = sum(any(n.probability > 0.5 for n in c.named) for c in outside)
    places = all_figures[0].located
    stated = [f"{_plain(places[g])} ({g})" for g in GROUPS if g in places]
    located = (
        f"On arms with two joints the one said to bear most of the gap is the hidden effect's in {', '.join(stated)}. "
        if stated
        else ""
    )
    pairs = [c for c in all_figures[0].cases if c.group == "two effects"]
    both = sum(c.found == len(c.hidden) for c in pairs)
    text = "## By kind of case\n\n" + table(("hidden", "right when", *_titles(all_figures)), rows)
    return text + (
        f"\n\nOf the pairs armgap names both in {both} of {len(pairs)}. Outside the library it says "
        f"*unexplained* in {unexplained} of {len(outside)}, and names a cause with a probability over 0.5 in {believed}. "
        f"{located}"
        f"*Not visible*: after re-estimating the parameters, predictions miss by less than {MULTIPLE:g} times what they miss by "
        f"without the effect, and the parameters move by less than {VISIBLE_SIGMAS:g} of the arm file's sigmas."
    )


def _effects(all_figures: Sequence[Figures]) -> str:
    shares = [f.by(lambda c: {h[0] for h in c.hidden}, f.visible) for f in all_figures]
    names = [e.name for e in REGISTRY.values() if any(e.name in s for s in shares)]
    rows = [(f"`{name}`", *(_plain(s.get(name)) for s in shares)) for name in sorted(names)]
    return (
        "## By hidden effect\n\nFirst cause and joint right, of the visible cases that hide the effect, alone or as one of two.\n\n"
        + table(("hidden effect", *_titles(all_figures)), rows)
    )


def _bands(all_figures: Sequence[Figures]) -> str:
    shares = [f.by_band for f in all_figures]
    rows = [(name, *(_plain(s.get(name)) for s in shares)) for name in shares[0]]
    return (
        "## By how far the effect stands out\n\nError of predictions over 0.2 s with the re-estimated arm, where it is largest, "
        "as a multiple of what it is without the effect; of a pair, the smaller.\n\n"
        + table(("stands out by", *_titles(all_figures)), rows)
    )


def _machines(first: Figures) -> str:
    by_model = first.by(lambda c: [f"{c.model} arm"], first.visible)
    by_style = first.by(lambda c: [f"{c.style} motion"], first.visible)
    rows = [(name, _percent(s)) for found in (by_model, by_style) for name, s in sorted(found.items())]
    return (
        "## By arm and motion\n\narmgap, visible effects of the library; the motion of the training log.\n\n"
        + table(("cases with", "right"), rows)
    )


def _calibration(first: Figures) -> str:
    made = first.calibration
    rows = [
        (f"{b.low:g} to {b.high:g}", str(b.count), str(b.right), f"{b.mean:.2f}", f"{b.right / b.count:.2f}")
        for b in made.bins
    ]
    if made.brier is None or made.ece is None:
        return ""
    return (
        "## Are the probabilities right?\n\nAll causes armgap named in all cases, also where nothing or something outside its library is "
        "hidden.\n\n"
        + table(("probability", "causes", "right", "mean probability", "share right"), rows)
        + f"\n\nBrier score {made.brier:.3f}, expected calibration error {made.ece:.3f}."
    )


def _sizes(first: Figures) -> str:
    stated = (
        []
        if first.size_error is None
        else [("median error of sizes, of causes rightly named", f"{first.size_error:.2%}")]
    )
    shut, ratio = first.closed, first.ratio
    closed = (
        []
        if shut is None
        else [
            (
                f"held-out gap closed, of what the true form with its true sizes closes: median, lower decile ({len(first.closings)} cases)",
                f"{shut[0]:.1%}, {shut[1]:.0%}",
            )
        ]
    )
    if ratio is not None:
        closed.append(
            (
                "RMS error on the holdout over that of the true form: median, upper decile",
                f"{ratio[0]:.2f}, {ratio[1]:.2f}",
            )
        )
    rows = [
        *closed,
        *stated,
        ("95 % intervals of sizes that hold the hidden size", _percent(first.coverage)),
        ("hidden effects called absent whose 95 % bound holds", _plain(first.bounds_hold)),
        ("look-alikes listed beside the first cause, mean", f"{first.alike:.1f}"),
        (
            "hidden effect named, or listed as a look-alike of the first cause",
            _percent(Share(sum(c.right or c.listed for c in first.visible), len(first.visible))),
        ),
        ("CPU time per case, median and largest", f"{first.seconds[0]:.1f} s, {first.seconds[1]:.1f} s"),
    ]
    return "## Sizes, bounds, time\n\narmgap.\n\n" + table(("what", "figure"), rows)


def _wrong(first: Figures) -> str:
    rows = [(c.case, c.group, c.headline) for c in first.cases if not c.right]
    return (
        f"## Where armgap was wrong\n\n{len(rows)} cases.\n\n" + table(("case", "kind", "hidden -> named"), rows)
        if rows
        else ""
    )


def _method(all_figures: Sequence[Figures]) -> str:
    lines = [f"- **{methods()[f.method].title}**: {methods()[f.method].settings}." for f in all_figures]
    return "## The methods\n\nAll get the same arm file and logs and name causes by the same names.\n\n" + "\n".join(
        lines
    )


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table with the header `head` and rows of cells."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _titles(all_figures: Sequence[Figures]) -> list[str]:
    return [methods()[f.method].title for f in all_figures]


def _percent(s: Share) -> str:
    if not s.of:
        return "-"
    low, high = s.interval
    return f"{s.value:.0%} ({s.right} of {s.of}) [{low:.0%}, {high:.0%}]"


def _plain(s: Share | None) -> str:
    return "-" if s is None or not s.of else f"{s.right} of {s.of}"
