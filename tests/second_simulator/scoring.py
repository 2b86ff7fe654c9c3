"""Scores of the answers: right first causes, wrongly named effects, and stated probabilities against shares that are right."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from armgap.trial.verdict import equivalent

Record = dict[str, Any]
#: Limits of the probability ranges for which the share of right causes is reported.
EDGES = (0.0, 0.5, 0.75, 0.9, 1.001)
#: Share of the mean square prediction error below which a hidden effect need not be named.
HALF = 0.5
#: Names of the parameters of the arm file, in the order of a key's ``theta``.
PARAMETERS = ("theta1", "theta2", "theta3", "theta4", "theta5", "viscous1", "viscous2", "coulomb1", "coulomb2")
#: Torques of effects outside the library, of unit size: the variables that they depend on, ``#`` for the number of the joint, and the function.
LAWS: dict[str, tuple[tuple[str, ...], Callable[..., Any]]] = {
    "cross_position": (("q1", "q2"), lambda q1, q2: np.sin(3.0 * q1) * np.cos(2.0 * q2)),
    "drift": (("t",), lambda t: t),
    "product": (("q#", "dq#"), lambda q, dq: q * np.abs(dq)),
}
#: Share of a law's range over which the true torque has to lie within the band.
RANGE = 0.9
#: Distance in time [s], beyond two of its standard deviations, within which a push counts as found.
NEAR = 0.1


def is_true(record: Record, cause: Record, main_only: bool = False) -> bool:
    """Return whether a cause, or one of its listed equivalents, is in the arm; with `main_only`, is the hidden effect and not clutter."""
    if cause["effect"] == "external_pulse":
        return not main_only and any(is_push(cause, push) for push in record.get("pushes", []))
    hidden = [(h["effect"], h["joint"]) for h in record["effects"] + ([] if main_only else record["clutter"])]
    if not main_only and record["family"].startswith("clutter"):
        # The lag of the current loop and the delay of the commands are in the arms of the clutter families even if they are not in the key.
        hidden += [(effect, j) for effect in ("actuator_lag", "actuator_delay") for j in (1, 2)]
    names = [(cause["effect"], cause["joint"])] + [(e["effect"], e["joint"]) for e in cause["equivalents"]]
    return any(equivalent(n, h) for n in names for h in hidden)


def is_push(cause: Record, push: Record) -> bool:
    """Return whether a push that a diagnosis names is one that was put in: in its log, on its joint, along it, and while it acts."""
    values = {name: value["value"] for name, value in cause["parameters"].items()}
    near = abs(values["time"] - push["time"]) < NEAR + 2.0 * push["width"]
    return bool(
        (cause["log"].split(" (")[0], cause["joint"]) == (push["log"], push["joint"])
        and near
        and values["impulse"] * push["impulse"] > 0
    )


def pushes(records: list[Record]) -> str:
    """Return how many pushes were named, how many named ones are false, and how their probabilities compare with shares that are right."""
    named = [(r, c) for r in records for c in r["causes"] if c["effect"] == "external_pulse"]
    true = [(r, p) for r in records for p in r.get("pushes", [])]
    found = sum(any(r is other and is_push(c, p) for other, c in named) for r, p in true)
    pairs = [(c["probability"], is_true(r, c)) for r, c in named]
    false = sum(not right for _, right in pairs)
    bins = "; ".join(_bin(pairs, low, high) for low, high in itertools.pairwise(EDGES))
    return f"pushes: {found} of {len(true)} named; of {len(named)} named {false} false; {bins}"


def laws(records: list[Record]) -> str:
    """Return how often joint and variables of a torque without a name are right, and its law; and how many others are listed."""
    asked, wrong = 0, 0
    parts, bands = [], []
    silent = [r for r in records if not r["effects"] and r["family"] == "null"]
    for r in records:
        for hidden in (h for h in r["effects"] if h["effect"] in LAWS):
            asked += 1
            names, torque = LAWS[hidden["effect"]]
            true = [v.replace("#", str(hidden["joint"])) for v in names]
            listed = r.get("unnamed", [])
            good = [d for d in listed if d["joint"] == hidden["joint"] and set(_variables(d)) <= set(true)]
            wrong += len(listed) - len(good)
            parts += [set(_variables(d)) == set(true) for d in good[:1]]
            for d in good[:1] if parts and parts[-1] else []:
                order = [_variables(d).index(v) for v in true]
                size = hidden["parameters"][hidden["effect"]]
                bands.append(_in_band(d, lambda *x, at=order, law=torque, unit=size: unit * law(*(x[i] for i in at))))
    entries = sum(bool(r.get("unnamed")) for r in silent)
    within = (
        f"{sum(b >= RANGE for b in bands)} of {len(bands)} within their band over {RANGE:.0%} of the range (median {np.median(bands):.2f})"
        if bands
        else "-"
    )
    return (
        f"laws without a name: of {asked} the joint and one or all of the variables are right in {len(parts)}, "
        f"all variables in {sum(parts)}; {within}; {wrong} further entries; of {len(silent)} arms without an effect {entries} have entries"
    )


def _variables(entry: Record) -> list[str]:
    return [entry["variable"], *([entry["grid"]["variable"]] if "grid" in entry else [])]


def _in_band(entry: Record, torque: Callable[..., Any]) -> float:
    """Return the share of the nodes of a table at which the true torque lies within the 95 % interval, but for a constant."""
    table: Record = entry.get("grid") or entry["law"]
    axes = [np.array(table[axis]) for axis in ("x", "y") if axis in table]
    found, sigma = np.array(table["torque"]), np.array(table["sigma"])
    off = torque(*np.meshgrid(*axes, indexing="ij")) - found
    off -= np.average(off, weights=sigma**-2.0)
    return float(np.mean(np.abs(off) < 1.96 * sigma))


def intervals(records: list[Record]) -> list[str]:
    """Return, by strength of the random torques and for all, the share of 95 % intervals of the arm's parameters that hold the true value."""
    records = [r for r in records if r.get("strength")]
    lines = []
    for strength in [*sorted({r["strength"] for r in records}), None]:
        of = [r for r in records if strength in (None, r["strength"])]
        for model in ("refit", "with_causes") if of else ():
            held = np.array([[_holds(r, model, i) for i in range(len(PARAMETERS))] for r in of])
            each = ", ".join(f"{name} {share:.2f}" for name, share in zip(PARAMETERS, held.mean(0), strict=True))
            label = "all" if strength is None else f"random torque of {strength:.0%}"
            lines.append(f"intervals, {label}, {model}: {len(of)} arms, {held.mean():.3f} hold ({each})")
    return lines


def _holds(record: Record, model: str, i: int) -> bool:
    found = record["parameters"][model][PARAMETERS[i]]
    return bool(found["sigma"] is None or abs(found["value"] - record["theta"][i]) < 1.96 * found["sigma"])


def report(records: list[Record], cases: bool) -> str:
    """Return the tables of scores as text, with a line for each case that is not right if `cases` is set."""
    failed = [r for r in records if "failed" in r]
    records = [r for r in records if "failed" not in r]
    lines = [f"{len(records)} answers, {len(failed)} failed", ""]
    lines.append(
        "family | asked | first right | among causes | all hidden named | as candidate only | no cause | wrong name >= 0.5 | seconds (median, max)"
    )
    for family in dict.fromkeys(r["family"] for r in records):
        of = [r for r in records if r["family"] == family]
        groups = {"": of}
        if any(r["share"] is not None for r in of):
            groups = {
                f" (share >= {HALF:g})": [r for r in of if (r["share"] or 0) >= HALF],
                " (less)": [r for r in of if (r["share"] or 0) < HALF],
            }
        for label, group in groups.items():
            if group:
                lines.append(_line(family + label, group))
    lines += ["", "claimed against right: all names of causes and candidates, by family group", ""]
    for label, chosen in {
        "inside the library": lambda r: r["family"] not in ("outside", "disturbed"),
        "clutter": lambda r: r["family"].startswith("clutter"),
        "outside": lambda r: r["family"] in ("outside", "disturbed"),
        "all": lambda r: True,
    }.items():
        pairs = [
            (c["probability"], is_true(r, c))
            for r in records
            if chosen(r)
            for c in r["causes"] + r["candidates"]
            if c["effect"] != "external_pulse"
        ]
        lines.append(f"{label}: " + "; ".join(_bin(pairs, low, high) for low, high in itertools.pairwise(EDGES)))
    lines += ["", pushes(records), laws(records), *intervals(records)]
    if cases:
        lines += [""] + [_case(r) for r in records if not _right(r)]
        lines += [f"{r['case']}: {r['failed']}" for r in failed]
    return "\n".join(lines)


def _right(r: Record) -> bool:
    if not r["effects"] or r["family"] == "outside":
        return not any(not is_true(r, c) and c["probability"] >= 0.5 for c in r["causes"])
    return bool(r["causes"]) and is_true(r, r["causes"][0], True)


def _line(label: str, of: list[Record]) -> str:
    first = sum(bool(r["causes"]) and is_true(r, r["causes"][0], True) for r in of)
    among = sum(any(is_true(r, c, True) for c in r["causes"]) for r in of)
    whole = sum(
        all(any(is_true({**r, "effects": [h]}, c, True) for c in r["causes"]) for h in r["effects"]) for r in of
    )
    candidate = sum(
        not any(is_true(r, c, True) for c in r["causes"]) and any(is_true(r, c, True) for c in r["candidates"])
        for r in of
    )
    silent = sum(not r["causes"] for r in of)
    wrong = sum(any(not is_true(r, c) and c["probability"] >= 0.5 for c in r["causes"]) for r in of)
    seconds = [r["seconds"] for r in of]
    return f"{label} | {len(of)} | {first} | {among} | {whole} | {candidate} | {silent} | {wrong} | {np.median(seconds):.1f}, {max(seconds):.0f}"


def _bin(pairs: list[tuple[float, bool]], low: float, high: float) -> str:
    inside = [(p, right) for p, right in pairs if low <= p < high]
    if not inside:
        return f"[{low:g}, {high:.2g}) -"
    claimed, right = np.mean([p for p, _ in inside]), np.mean([r for _, r in inside])
    return f"[{low:g}, {high:.2g}) {len(inside)}: claimed {claimed:.2f}, right {right:.2f}"


def _case(r: Record) -> str:
    def names(causes: list[Record]) -> str:
        return ", ".join(
            f"{c['effect']}:{c['joint'] or ''} {c['probability']:.2f}{'' if is_true(r, c) else '!'}" for c in causes
        )

    hidden = ", ".join(f"{h['effect']}:{h['joint'] or ''}" for h in r["effects"]) or "nothing"
    share = "" if r["share"] is None else f" share {r['share']:.2f}"
    after = "/".join(f"{a / f:.0f}" for a, f in zip(r["gap"]["after"], r["gap"]["floor"], strict=True))
    found = f"{r['verdict']} [{names(r['causes'])}] ({names(r['candidates'])})"
    return f"{r['case']}: {hidden}{share} -> {found}, {after} floors, {r['seconds']:.0f} s"
