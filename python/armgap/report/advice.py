"""Recommended next steps after a diagnosis, a few lines by its verdict and contents."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from armgap import _native
from armgap.literals import SERIAL
from armgap.remainder import leaves_part
from armgap.report.words import doubtful, named, percent, title

__all__ = ["next_steps"]

Data = dict[str, Any]

#: Largest number of unexcited effects that the next steps list; a section of the report lists all.
LISTED = 3
_EXPORT = "`armgap export DIAGNOSIS.json --arm ARM.toml -o corrected.toml` (`.xml` for MuJoCo, `.urdf` for URDF)"
_INTO_MODEL = "; `--model ROBOT.urdf -o corrected.urdf` writes them into your own description"
_AGAIN = "After a repair, diagnose a log of the same motion and compare: `armgap compare DIAGNOSIS.json REPAIRED.json`."
_MEASURE_TORQUE = (
    "Log more: the measured torque (motor current times torque constant), {}, tells whether the gap lies in the drive; note the times of any "
    "contact or load."
)
_BESIDE, _INSTEAD = (
    "in columns `tau_meas1` and so on beside the command",
    "mapped to the tau columns in place of the command",
)
_TAKE_MEASURED_TORQUE = (
    "The section on the chain says what arises in the drive. To see the mechanics alone, diagnose again with the measured torque in place of the "
    "command (`--columns tau1=tau_meas1` and so on for every joint); note the times of any contact or load."
)
_OWN = "If you suspect a law, write it as a custom effect and give it to `armgap.diagnose(..., effects=[...])`."


def next_steps(data: Data) -> list[str]:
    """Return the recommended next steps, most urgent first.

    Parameters
    ----------
    data : dict
        Diagnosis as a JSON object.
    """
    return [*([] if _is_serial(data) else _impossible(data)), *_BY_VERDICT.get(data["verdict"], _none)(data)]


def _is_serial(data: Data) -> bool:
    return (data.get("arm") or {}).get("kind") == SERIAL


def _export(data: Data) -> str:
    return _EXPORT + (_INTO_MODEL if _is_serial(data) else "")


def _input(data: Data) -> list[str]:
    remedies = [_remedy(c) for c in data.get("checks") or [] if c["severity"] == "error"]
    steps = [f"Apply the remedy and diagnose again: {text}." for text in dict.fromkeys(filter(None, remedies))]
    return [
        *(steps or ["Correct the input and diagnose again."]),
        "Effects are not judged until the input agrees with the arm file.",
    ]


def _remedy(check: Data) -> str:
    several = check.get("remedies") or list(filter(None, [check.get("remedy")]))
    text = " or ".join(f"`{r}`" for r in several)
    return f"{text} (no log tells these apart; choose by looking at the arm)" if len(several) > 1 else text


def _none(data: Data) -> list[str]:
    return ["Nothing is left to shrink on this motion: keep the arm file.", *_excite(data)]


def _parameters(data: Data) -> list[str]:
    return [f"Take over the re-estimated values: {_export(data)}.", *_excite(data)]


def _effect(data: Data) -> list[str]:
    steps = [_alike(c, data) for c in data["causes"] if c.get("equivalents")]
    steps.append(f"Export the corrected model: {_export(data)}.")
    steps.append(_AGAIN)
    if leaves_part(data):
        left = float(data["gap"]["unexplained"])
        steps.append(f"The causes leave {percent(left)} of the gap of the re-estimated arm file. {_log_more(data)}")
    elif doubtful(data):
        steps.append(_log_more(data))
    return steps


def _alike(cause: Data, data: Data) -> str:
    others = " or ".join(dict.fromkeys(named(e) for e in cause["equivalents"]))
    text = f"These logs do not tell {named(cause)}, from {others}: look at the arm before you repair it"
    if any(e.get("motion_separates", True) for e in cause["equivalents"]):
        text += ", or record another motion" + ("" if _is_serial(data) else ", which armgap plan finds")
        return f"{text}; the section on look-alikes says which of them it may separate."
    return f"{text}; no motion separates them, and the section on look-alikes says why."


def _unexplained(data: Data) -> list[str]:
    if data["gap"].get("training"):
        return [
            "Exchange training and holdout logs, or record logs that both hold all motions, and diagnose again.",
            *_excite(data),
        ]
    places = data.get("where") or []
    steps = [f"Look at joint {places[0]['joint']} first: that is where the torque is lacking."] if places else []
    return [*steps, _log_more(data), *([] if _is_serial(data) else [_OWN]), *_excite(data)]


def _log_more(data: Data) -> str:
    """Return what to log beside these signals, or how to use the measured torque where the logs hold it."""
    if any(part["stage"] == "drive" for part in data.get("chain") or []):
        return _TAKE_MEASURED_TORQUE
    return _MEASURE_TORQUE.format(_INSTEAD if _is_serial(data) else _BESIDE)


def _excite(data: Data) -> list[str]:
    """Return lines with motions to record that show or rule out the unexcited effects."""
    silent = dict.fromkeys(r["effect"] for r in data.get("ruled_out") or [] if r["status"] == "not excited")
    if not silent:
        return []
    needs = {entry["name"]: str(entry["excited_by"]) for entry in _native.effects()}
    shown = [f"{title(name)} needs {needs[name]}" for name in silent if name in needs][:LISTED]
    more = f"; and {len(silent) - len(shown)} more effects" if len(silent) > len(shown) else ""
    return [f"To rule out what these logs do not excite, record other motion: {'; '.join(shown)}{more}."]


def _impossible(data: Data) -> list[str]:
    broken = [c["check"] for c in data.get("plausibility") or [] if not c["holds"]]
    return [f"First find out why this does not hold: {'; '.join(broken)}. No arm has such values."] if broken else []


_BY_VERDICT: dict[str, Callable[[Data], list[str]]] = {
    "none": _none,
    "parameters": _parameters,
    "effect": _effect,
    "unexplained": _unexplained,
    "input": _input,
}
