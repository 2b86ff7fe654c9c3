"""Report sections on the logs and their quality, and on the method."""

from __future__ import annotations

import platform

from armgap.literals import SERIAL
from armgap.report.page import Section, Table
from armgap.report.sections.model_labels import Data, small_unit
from armgap.report.words import error_text, figure

__all__ = ["data_quality", "method"]


def data_quality(data: Data) -> Section:
    """Return the section on the logs, findings in them, and remarks."""
    logs = [(log, use) for use in ("training", "holdout") for log in data.get(use) or []]
    has_zeros = any(log.get("encoder_zero") for log, _ in logs)
    rows = [
        (log["name"], use, str(log["samples"]), f"{log['duration_s']:.2f}", str(log["windows"]))
        + ((_zero(log),) if has_zeros else ())
        for log, use in logs
    ]
    found = [(f["log"], f["kind"], f["message"]) for f in data.get("log_findings") or []]
    header = ("log", "use", "samples", "duration [s]", "windows")
    tables = [Table(header + ((f"encoder zeros [{small_unit(data)}]",) if has_zeros else ()), rows)]
    if found:
        tables.append(Table(("log", "noticed", "what"), found))
    remarks = [f"Note: {note}." for note in data.get("notes") or []]
    if not found:
        remarks.append("Nothing unusual was noticed in the logs.")
    return Section("The logs and their quality", text=_noise(data), tables=tables, notes=remarks)


def _zero(log: Data) -> str:
    """Return the encoder readings of a log at the model's zero positions, joint by joint."""
    zero = log.get("encoder_zero")
    if not zero:
        return ""
    pairs = zip(zero["value"], zero["sigma"], strict=True)
    return ", ".join(f"{1e3 * value:.2f} ± {error_text(1e3 * sigma)}" for value, sigma in pairs)


def _noise(data: Data) -> list[str]:
    noise = data.get("noise") or {}
    if not noise:
        return []
    sigma = " / ".join(error_text(1e3 * v) for v in noise["position_sigma"])
    step = " / ".join(figure(1e3 * v) if v else "none seen" for v in noise["encoder_step"])
    unit = small_unit(data)
    return [f"Position noise (one standard deviation, per joint): {sigma} {unit}; encoder step: {step} {unit}."]


def method(data: Data) -> Section:
    """Return the section on method, options, versions and seed of a diagnosis."""
    text = [_OF_SERIAL_ARMS if (data.get("arm") or {}).get("kind") == SERIAL else _OF_WINDOWS]
    return Section("How this was computed", text=text, tables=[Table(("what", "value"), _facts(data))])


_OF_WINDOWS = (
    "The logs are cut into short windows. Each starts from its measured state, which is itself fitted within its noise, and runs under the "
    "logged torque through a simulator with dry friction whose reversals are located inside the steps. Parameters and effects are fitted "
    "together to the positions; what the arm file states with its standard deviations enters as prior knowledge. Probabilities and intervals "
    "come from resampled windows."
)
_OF_SERIAL_ARMS = (
    "The equation of motion along the measured path is weighted with smooth test functions (weak form), which needs no accelerations. The arm's "
    "parameters, with what the arm file states with its standard deviations as prior knowledge, and the terms that the model may lack are fitted "
    "to the logged torques. A term is accepted where it explains torque on the holdout too, beyond the scatter between blocks of one second. "
    "Probabilities come from resampled blocks. Predictions over short windows only say how far the gap shrinks."
)


def _facts(data: Data) -> list[tuple[str, str]]:
    arm, options = data.get("arm") or {}, data.get("options") or {}
    smoothing = options.get("friction_widths") or [options.get("friction_smoothing") or 0.0]
    facts = [
        ("arm", f"{arm.get('name', '')} ({arm.get('kind', '')}, {arm.get('n_joints', '')} joints)"),
        ("prediction horizon", f"{options.get('horizon_s', '')} s"),
        ("effects at most", str(options.get("max_causes", ""))),
        ("seed of the resampling", str(options.get("seed", ""))),
        (
            "friction",
            "smoothed over " + ", ".join(map(figure, smoothing)) + " rad/s (m/s on linear joints)"
            if any(smoothing)
            else "dry",
        ),
        ("schema", str(data.get("schema", ""))),
        ("armgap", str(data.get("version", ""))),
        ("drawn with", _drawn_with()),
        ("time taken", f"{figure(data.get('seconds') or 0.0)} s"),
    ]
    return [fact for fact in facts if fact[1]]


def _drawn_with() -> str:
    from importlib.metadata import version

    return f"bokeh {version('bokeh')}, Python {platform.python_version()}"
