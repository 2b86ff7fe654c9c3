"""Findings about a log that do not prevent a diagnosis."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

__all__ = ["Finding", "counted", "remarks"]

# Kinds of findings that are reported for each log: changes and interpretations of the log; other kinds are reported once.
_TOLD_EACH = frozenset({"units", "format", "joints", "torque", "clock", "cleaned", "corrected", "stretches"})


@dataclass(frozen=True)
class Finding:
    """Finding about a log that its reader should know, but that does not prevent a diagnosis.

    Attributes
    ----------
    kind : str
        Kind of finding. Interpretation of the log: ``"format"``, ``"units"``, ``"joints"``, ``"torque"``, ``"clock"``, ``"columns"``. Changes
        of the log: ``"cleaned"``, ``"corrected"``, ``"stretches"``. Other remarks: ``"sampling"``, ``"period"``, ``"gap"``, ``"constant"``,
        ``"limit"``, ``"checks"``.
    message : str
        The finding in words.
    times : tuple of float
        Times of the finding from the log's first sample [s], for charts; 200 at most.
    """

    kind: str
    message: str
    times: tuple[float, ...] = ()


def counted(count: int, thing: str) -> str:
    """Return a count with its noun as text, in the plural unless the count is 1.

    Examples
    --------
    >>> counted(1, "row"), counted(3, "row")
    ('1 row', '3 rows')
    """
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"


def remarks(entries: Iterable[Mapping[str, str]]) -> list[str]:
    """Return findings (``log``, ``kind``, ``message``) as lines; equal findings in several logs share one line.

    Examples
    --------
    >>> seen = [{"log": name, "kind": "units", "message": "times are in ms"} for name in ("a", "b")]
    >>> remarks([*seen, {"log": "c", "kind": "gap", "message": "1 gap"}, {"log": "d", "kind": "gap", "message": "2 gaps"}])
    ['a, b: times are in ms', 'c: 1 gap (and 1 more like it)']
    """
    groups: dict[tuple[str, str], list[Mapping[str, str]]] = {}
    for entry in entries:
        told_each = entry["message"] if entry["kind"] in _TOLD_EACH else ""
        groups.setdefault((entry["kind"], told_each), []).append(entry)
    return [_line(group, same=bool(told_each)) for (_, told_each), group in groups.items()]


def _line(group: list[Mapping[str, str]], *, same: bool) -> str:
    if same:
        return f"{', '.join(dict.fromkeys(entry['log'] for entry in group))}: {group[0]['message']}"
    more = f" (and {len(group) - 1} more like it)" if len(group) > 1 else ""
    return f"{group[0]['log']}: {group[0]['message']}{more}"
