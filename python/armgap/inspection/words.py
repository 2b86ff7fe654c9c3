"""Texts and text tables of an inspection, for terminal and HTML page."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable
from typing import TYPE_CHECKING

from armgap.inspection.unmapped import FACTOR_PLACEHOLDER

if TYPE_CHECKING:
    from armgap.inspection.channels import JointChannels
    from armgap.inspection.excitation import Excitation
    from armgap.inspection.inspection import Inspection
    from armgap.inspection.unmapped import Columns

__all__ = ["COLUMN_HEADER", "column_rows", "grids", "overview", "proposal"]

Grid = tuple[list[str], list[list[str]]]
COLUMN_HEADER = ("column", "type", "unit", "lowest", "highest", "trend", "missing")
"""Header of the table of a file's columns without a mapping to standard names."""
_UNKNOWN = 10.0  # standard deviation, as a multiple of a parameter's value, from which the parameter is unknown
_RECOMMENDED = 100.0  # condition number up to which a motion counts as a good one


def overview(found: Inspection) -> list[tuple[str, str]]:
    """Return properties of a whole log as pairs of label and text: columns, samples, rate, jitter, gaps, excitation."""
    s = found.sampling
    answers = [
        (
            "columns",
            ", ".join(key if key == name else f"{key} = {name}" for key, name in found.columns.items()) or "arrays",
        ),
        ("samples", f"{s.samples:,} over {_duration(s.duration_s)}".replace(",", "\N{NARROW NO-BREAK SPACE}")),
        ("rate", f"{s.rate_hz:.6g} Hz (median period {s.period_s * 1e3:.4g} ms)"),
        ("jitter", _jitter(s.jitter_s, s.jitter_max_s)),
        ("gaps", _gaps(found)),
    ]
    if found.excitation is not None:
        answers.append(("excitation", _excitation(found.excitation)))
    return answers


def _duration(seconds: float) -> str:
    """Return a duration [s] as text, with minutes or hours in brackets for a long one.

    Examples
    --------
    >>> _duration(9.9975), _duration(7200.0)
    ('9.9975 s', '7200 s (2.0 h)')
    """
    text = f"{seconds:.6g} s"
    if seconds < 120:
        return text
    return f"{text} ({seconds / 60:.1f} min)" if seconds < 7200 else f"{text} ({seconds / 3600:.1f} h)"


def _jitter(rms_s: float, most_s: float) -> str:
    if most_s < 1e-9:
        return "none (below 1 ns)"
    return f"{_short(rms_s)} RMS, {_short(most_s)} at most"


def _short(seconds: float) -> str:
    return f"{seconds * 1e6:.3g} µs" if seconds < 1e-3 else f"{seconds * 1e3:.3g} ms"


def _gaps(found: Inspection) -> str:
    s = found.sampling
    if not s.gaps:
        return "none longer than three periods"
    widest = ", ".join(f"{length * 1e3:.3g} ms at {t:.6g} s" for t, length in s.widest)
    return f"{s.gaps}, together {s.gap_s:.3g} s; the widest: {widest}"


def _plain(number: float) -> str:
    return f"{number:.0f}" if 1e3 <= number < 1e6 else f"{number:.3g}"


def _excitation(e: Excitation) -> str:
    weak = [p.name for p in e.parameters if p.excited != "well"]
    quality = (
        "good" if e.condition <= _RECOMMENDED else f"above {_RECOMMENDED:g} parameters can stand in for each other"
    )
    said = f"condition number {_plain(e.condition)} ({quality})"
    said += f"; least excited: {e.weakest}" if weak else ""
    return f"{said}; not well excited: {', '.join(weak)}" if weak else f"{said}; every parameter is well excited"


def grids(found: Inspection) -> list[tuple[str, Grid]]:
    """Return the tables of an inspection with their titles: joints, and with an arm its parameters."""
    all_grids = [("Joints", _joints(found))]
    if found.excitation is not None:
        share = "Standard deviation of each parameter if the torque carried white noise of 1 % of its RMS"
        all_grids.append((share, _parameters(found.excitation)))
    return all_grids


def _joints(found: Inspection) -> Grid:
    header = ["", *(f"joint {j.joint}" for j in found.joints)]
    length, load = found.units
    lines: list[tuple[str, Callable[[JointChannels], str]]] = [
        (f"position [{length}]", lambda j: f"{j.q_range[0]:.4g} to {j.q_range[1]:.4g}"),
        (f"position step [{length}]", _position_step),
        (f"speed, 99 % below [{_rate(length)}]", lambda j: f"{j.top_speed:.4g}"),
        ("at rest", lambda j: f"{100 * j.rest:.1f} %"),
        ("in motion", lambda j: f"{100 * j.motion:.1f} %"),
        ("reversals", lambda j: f"{j.reversals}"),
    ]
    if found.source.has_torques:
        lines += [
            (f"torque [{load}]", lambda j: " to ".join(f"{x:.4g}" for x in j.tau_range or ())),
            (f"torque step [{load}]", lambda j: "none" if j.tau_step is None else f"{j.tau_step:.4g}"),
            ("torque cut off", _flat),
        ]
    return header, [[name, *(of(j) for j in found.joints)] for name, of in lines]


def _rate(length: str) -> str:
    return " or ".join(f"{unit}/s" for unit in length.split(" or "))


def _position_step(j: JointChannels) -> str:
    said = "none" if j.q_step is None else f"{j.q_step:.5g}"
    if j.q_step_arm is None or (j.q_step is not None and abs(j.q_step / j.q_step_arm - 1) < 0.01):
        return said
    return f"{said} (arm file: {j.q_step_arm:.5g})"


def _flat(j: JointChannels) -> str:
    return "; ".join(f"at {f.level:.4g}: {100 * f.share:.1f} %, up to {f.longest_s:.3g} s" for f in j.flat_tops) or "no"


def _parameters(e: Excitation) -> Grid:
    def percent(x: float) -> str:
        return f"{100 * x:.3g} %" if math.isfinite(x) and x < _UNKNOWN else "all of it"

    rows = [[p.name, f"{p.value:.4g}", percent(p.alone), percent(p.sigma), p.excited] for p in e.parameters]
    return ["parameter", "arm file", "alone", "with all others", "excited"], rows


def column_rows(found: Columns) -> list[tuple[str, ...]]:
    """Return one table row per column of a file without a mapping to standard names."""

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.6g}"

    return [
        (c.name, c.dtype, c.unit or "", number(c.low), number(c.high), c.trend, str(c.missing or ""))
        for c in found.columns
    ]


def proposal(found: Columns, file: str, arm_file: str | None) -> list[str]:
    """Return lines with a command that reads a file by the proposed mapping of its columns, and with what the user has to verify or to add."""
    beside = "" if arm_file is None else f"--arm {shlex.quote(arm_file)} "
    lines = [
        "not all of t, q1, tau1 and so on are there, and no mapping was given; by their names these may be meant:",
        f"armgap inspect {shlex.quote(file)} {beside}{found.options}",
        "make sure of each: t times, q positions as measured, tau torques at the joint, positive where they turn the joint towards greater q",
    ]
    open_names = [key for key, name in found.proposed.items() if name == "NAME"]
    if open_names:
        lines.append(f"no column suggests itself for {', '.join(open_names)}: put its name in place of NAME")
    for key, unit in found.currents.items():
        lines.append(
            f"`{found.proposed[key]}` is a current, of which no unit makes a torque: put its factor in place of {FACTOR_PLACEHOLDER}, "
            f"N m at the joint per {unit or 'unit of the current'} (torque constant times gear ratio)"
        )
    if found.problem:
        lines.append(f"read so it ends with: {found.problem}")
    return lines
