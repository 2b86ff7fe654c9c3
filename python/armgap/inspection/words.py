"""An inspection in words and tables of words, for the terminal and the page alike."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armgap.inspection.channels import Joint
    from armgap.inspection.excitation import Excitation
    from armgap.inspection.inspection import Inspection

__all__ = ["grids", "overview"]

Grid = tuple[list[str], list[list[str]]]
_UNKNOWN = 10.0  # ten times the value
_RECOMMENDED = 100.0  # condition number up to which a motion counts as a good one


def overview(found: Inspection) -> list[tuple[str, str]]:
    """Return questions and answers on the whole log."""
    s = found.sampling
    answers = [
        (
            "columns",
            ", ".join(key if key == name else f"{key} = {name}" for key, name in found.columns.items()) or "arrays",
        ),
        ("samples", f"{s.samples} over {s.duration_s:.6g} s"),
        ("rate", f"{s.rate_hz:.6g} Hz (median period {s.period_s * 1e3:.4g} ms)"),
        ("jitter", f"{s.jitter_s * 1e6:.3g} us RMS, {s.jitter_max_s * 1e6:.3g} us at most"),
        ("gaps", _gaps(found)),
    ]
    if found.excitation is not None:
        answers.append(("excitation", _excitation(found.excitation)))
    return answers


def _gaps(found: Inspection) -> str:
    s = found.sampling
    if not s.gaps:
        return "none longer than three periods"
    widest = ", ".join(f"{length * 1e3:.3g} ms at {t:.6g} s" for t, length in s.widest)
    return f"{s.gaps}, together {s.gap_s:.3g} s; the widest: {widest}"


def _excitation(e: Excitation) -> str:
    weak = [p.name for p in e.parameters if p.excited != "well"]
    quality = (
        "good" if e.condition <= _RECOMMENDED else f"above {_RECOMMENDED:g} parameters can stand in for each other"
    )
    said = f"condition number {e.condition:.3g} ({quality})"
    said += f"; told least: {e.weakest}" if weak else ""
    return f"{said}; not well excited: {', '.join(weak)}" if weak else f"{said}; every parameter is well excited"


def grids(found: Inspection) -> list[tuple[str, Grid]]:
    """Return titles and tables."""
    all_grids = [("Joints", _joints(found))]
    if found.excitation is not None:
        share = "What 1 % of the RMS torque as white error would do to each parameter"
        all_grids.append((share, _parameters(found.excitation)))
    return all_grids


def _joints(found: Inspection) -> Grid:
    header = ["", *(f"joint {j.joint}" for j in found.joints)]
    lines = (
        ("position", lambda j: f"{j.q_range[0]:.4g} to {j.q_range[1]:.4g}"),
        ("position step", _position_step),
        ("speed, 99 % below", lambda j: f"{j.top_speed:.4g}"),
        ("at rest", lambda j: f"{j.rest:.1%}"),
        ("in motion", lambda j: f"{j.motion:.1%}"),
        ("reversals", lambda j: f"{j.reversals}"),
        ("torque", lambda j: f"{j.tau_range[0]:.4g} to {j.tau_range[1]:.4g}"),
        ("torque step", lambda j: "none" if j.tau_step is None else f"{j.tau_step:.4g}"),
        ("torque cut off", _flat),
    )
    return header, [[name, *(of(j) for j in found.joints)] for name, of in lines]


def _position_step(j: Joint) -> str:
    said = "none" if j.q_step is None else f"{j.q_step:.5g}"
    if j.q_step_arm is None or (j.q_step is not None and abs(j.q_step / j.q_step_arm - 1) < 0.01):
        return said
    return f"{said} (arm file: {j.q_step_arm:.5g})"


def _flat(j: Joint) -> str:
    return "; ".join(f"at {f.level:.4g}: {f.share:.1%}, up to {f.longest_s:.3g} s" for f in j.flat_tops) or "no"


def _parameters(e: Excitation) -> Grid:
    def percent(x: float) -> str:
        return f"{100 * x:.3g} %" if math.isfinite(x) and x < _UNKNOWN else "all of it"

    rows = [[p.name, f"{p.value:.4g}", percent(p.alone), percent(p.sigma), p.excited] for p in e.parameters]
    return ["parameter", "arm file", "alone", "with all others", "excited"], rows
