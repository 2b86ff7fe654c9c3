"""What the checks of a serial arm's logs change in its diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from armgap.check.check import Check

__all__ = ["serial_settings"]

_FILTERED_HALF_WIDTH_S = 0.4
"""Half width of the test functions of a log that was low-passed before it was written [s]: they pass half of 1.25 Hz, less than such filters do."""
_UNKNOWN_UNITS = (
    "torques have the unit that the arm file's masses give them: no load, wrong link or torque gain can be told"
)


def serial_settings(checks: Sequence[Check]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return settings of the core's diagnosis of a serial arm and notes for its result, given what was noticed in the logs.

    Parameters
    ----------
    checks : sequence of Check
        What was noticed.

    Returns
    -------
    settings : dict
        ``half_width`` where positions were low-passed, and whether the torques' unit is known by itself, ``known_units``.
    notes : tuple of str
    """
    noticed = {check.check for check in checks}
    settings: dict[str, Any] = {"known_units": "torque_unit" not in noticed}
    if "filtered_positions" in noticed:
        settings["half_width"] = _FILTERED_HALF_WIDTH_S
    return settings, () if settings["known_units"] else (_UNKNOWN_UNITS,)
