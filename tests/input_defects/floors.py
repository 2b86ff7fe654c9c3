"""Noise floors that diagnoses report against true ones, and verdicts against the gap that remains."""

from __future__ import annotations

import numpy as np

from .judging import Record
from .tables import percent, table

#: Smallest and largest ratio of the reported to the true noise floor that counts as right.
BAND = (0.7, 1.4)
#: A remaining gap matters if it exceeds this many true noise floors and this share of the RMS displacement over the horizon.
FLOORS, SHARE = 4.0, 0.001
#: Stage of the gap in a diagnosis that remains under a verdict without effects: as found, or after re-estimation and selection.
REMAINS = {"none": "before", "parameters": "after"}


def floor_section(records: list[Record]) -> str:
    """Return the section of the page about noise floors and verdicts."""
    answered = [r for r in records if "failed" not in r and "true" in r]
    lines = [_line("all joints", answered)]
    for model in dict.fromkeys(r["model"] for r in answered):
        lines.append(_line(model, [r for r in answered if r["model"] == model]))
    head = ["joints of", "joints", "0.7 to 1.4", "5 %", "median", "95 %"]
    parts = [TEXT, table(head, lines), _contradictions(answered, len(records))]
    return "## Floor and verdict\n\n" + "\n\n".join(parts)


TEXT = """\
The true floor is what the true arm, run from the measured starts, misses the measured positions of the holdout by (`true_floor.py`);
half of the cases have white noise of 0.5 to 10 counts beside the rounding. Claimed over true floor, joint by joint."""


def ratios(records: list[Record]) -> np.ndarray:
    """Return the ratio of reported to true noise floor of every joint of every record."""
    return np.array([c / t for r in records for c, t in zip(r["gap"]["floor"], r["true"]["floor"], strict=True)])


def _line(name: str, records: list[Record]) -> list[str]:
    own = ratios(records)
    spread = [f"{x:.2f}" for x in np.quantile(own, [0.05, 0.5, 0.95])] if len(own) else ["-"] * 3
    return [name, str(len(own)), _inside(own), *spread]


def _inside(ratio: np.ndarray) -> str:
    return percent(int(np.sum((ratio >= BAND[0]) & (ratio <= BAND[1]))), len(ratio))


def contradicts(record: Record) -> list[str]:
    """Return a line for each joint whose remaining gap is too large for the record's verdict; empty if there are none."""
    if record["verdict"] not in REMAINS:
        return []
    left, true = record["gap"][REMAINS[record["verdict"]]], record["true"]
    return [
        f"joint {j + 1}: {gap:.3g} over a floor of {floor:.3g}, {100 * gap / travel:.2f} % of the displacement"
        for j, (gap, floor, travel) in enumerate(zip(left, true["floor"], true["travel"], strict=True))
        if gap > FLOORS * floor and gap > SHARE * travel
    ]


def _contradictions(records: list[Record], asked: int) -> str:
    found = [(r, said) for r in records if (said := contradicts(r))]
    text = f"Verdicts `none` or `parameters` beside a gap of more than {FLOORS:g} floors and {100 * SHARE:g} % of the RMS displacement\n"
    text += f"over the horizon: {len(found)} of {len(records)} answers ({asked - len(records)} cases without one)."
    if not found:
        return text
    lines = [[r["case"], r["verdict"], "; ".join(said), _hidden(r)] for r, said in found]
    return text + "\n\n" + table(["case", "verdict", "what remains", "hidden"], lines)


def _hidden(record: Record) -> str:
    return ", ".join(f"{effect}:{joint or ''}" for effect, joint in record["hidden"]) or "nothing"
