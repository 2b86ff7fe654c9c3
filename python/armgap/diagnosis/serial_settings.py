"""Settings of a serial arm's diagnosis that depend on the checks of its logs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from armgap.check.check import Check

__all__ = ["serial_settings"]

_FILTERED_HALF_WIDTH_S = 0.4
"""Half width of the test functions for a log with low-passed positions [s]: their gain at 1.25 Hz is one half, less than that of usual filters."""
_UNKNOWN_UNITS = (
    "torques have the unit that the arm file's masses give them: no load, wrong link or torque gain can be told"
)


def serial_settings(checks: Sequence[Check]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return settings of the core's diagnosis of a serial arm and notes for its result, given the checks of its logs.

    Parameters
    ----------
    checks : sequence of Check
        Checks of the logs.

    Returns
    -------
    settings : dict
        ``half_width`` where positions were low-passed, and ``known_units``, whether the torques' unit is known.
    notes : tuple of str
        Remarks for the result of the diagnosis.
    """
    noticed = {check.check for check in checks}
    settings: dict[str, Any] = {"known_units": "torque_unit" not in noticed}
    if "filtered_positions" in noticed:
        settings["half_width"] = _FILTERED_HALF_WIDTH_S
    return settings, () if settings["known_units"] else (_UNKNOWN_UNITS,)
