"""Spellings of units in files: ``q1 [deg]``, ``tau1 (N·m)``, ``t_ms``."""

from __future__ import annotations

import re

__all__ = ["foreign", "is_foreign", "stripped", "suffixed", "unit_of"]

_SPELLINGS = {
    "s": ("s", "sec", "second", "seconds"),
    "ms": ("ms", "msec", "millisecond", "milliseconds"),
    "us": ("us", "µs", "μs", "usec", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanosecond", "nanoseconds"),
    "rad": ("rad", "radian", "radians"),
    "mrad": ("mrad", "milliradian", "milliradians"),
    "deg": ("deg", "°", "º", "degree", "degrees"),
    "turns": ("turn", "turns", "rev", "revs", "revolution", "revolutions"),
    "m": ("m", "meter", "meters", "metre", "metres"),
    "mm": ("mm",),
    "rad/s": ("rad/s", "rad/sec", "rads^-1", "rads-1", "rad_s"),
    "mrad/s": ("mrad/s", "mrad/sec", "mrads^-1", "mrads-1", "mrad_s"),
    "rpm": ("rpm", "r/min", "rev/min"),
    "deg/s": ("deg/s", "deg/sec", "°/s", "º/s", "degs^-1", "degs-1", "deg_s"),
    "m/s": ("m/s", "ms^-1", "m_s"),
    "mm/s": ("mm/s", "mms^-1", "mm_s"),
    "Nm": ("Nm", "N-m", "newtonmeter", "newton-meter"),
    "mNm": ("mNm", "mN-m", "Nmm", "N-mm"),
    "N": ("N", "newton"),
    "kN": ("kN",),
}
_UNITS = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings}
_BRACKET = re.compile(r"^(?P<name>.*\S)\s*(?:\[(?P<square>[^\[\]]+)\]|\((?P<round>[^()]+)\))$")
# What a unit is spelled with: text of other characters, a number alone, and the words that say that there is no unit, state none.
_UNIT_LIKE = re.compile(
    r"(?!(?:none|unknown|dimensionless|n/a|-)$)(?=.*[^\d\s])[A-Za-zµμΩ°º%·⋅*/^²\d\s-]{1,12}", re.IGNORECASE
)
_SUFFIX = re.compile(r"^(?P<name>t|t_tau|(?:q|tau|dq|tau_meas|q_link)[1-9][0-9]*)_(?P<unit>[A-Za-z_]+)$")


def unit_of(text: str) -> str | None:
    """Return the unit that a text spells; None if it spells no unit.

    Examples
    --------
    >>> unit_of("N·m"), unit_of("Degrees"), unit_of("counts")
    ('Nm', 'deg', None)
    """
    bare = re.sub(r"[\s·⋅*.]", "", text)
    return _UNITS.get(bare) or _UNITS.get(bare.lower())


def stripped(column: str) -> tuple[str, str | None]:
    """Return a column's name without its unit, and the unit.

    Examples
    --------
    >>> stripped("q1 [deg]"), stripped("position[0]")
    (('q1', 'deg'), ('position[0]', None))
    """
    match = _BRACKET.match(column.strip())
    unit = unit_of(match["square"] or match["round"]) if match else None
    return (match["name"], unit) if match and unit else (column.strip(), None)


def foreign(column: str) -> tuple[str, str] | None:
    """Return a column's name without its unit, and the unit, where it is none that armgap knows; None where the name states no such unit.

    Square brackets behind a blank state a unit, round ones may hold anything.

    Examples
    --------
    >>> foreign("tau1 [A]"), foreign("tau1 [Nm]"), foreign("position[elbow]"), foreign("q1 (elbow)")
    (('tau1', 'A'), None, None, None)
    """
    match = _BRACKET.match(column.strip())
    if match is None or match["square"] is None or not column.strip()[len(match["name"])].isspace():
        return None
    unit = match["square"].strip()
    return (match["name"], unit) if is_foreign(unit) else None


def is_foreign(text: str) -> bool:
    """Return whether a text spells a unit that armgap does not know.

    Examples
    --------
    >>> is_foreign("counts"), is_foreign("Nm"), is_foreign("none"), is_foreign("")
    (True, False, False, False)
    """
    return unit_of(text) is None and _UNIT_LIKE.fullmatch(text.strip()) is not None


def suffixed(column: str) -> tuple[str, str | None]:
    """Return a standard name and the unit behind its underscore, as in ``t_ms``.

    Examples
    --------
    >>> suffixed("q1_deg"), suffixed("t_start")
    (('q1', 'deg'), ('t_start', None))
    """
    match = _SUFFIX.match(column)
    unit = _UNITS.get(match["unit"]) if match else None
    return (match["name"], unit) if match and unit else (column, None)
