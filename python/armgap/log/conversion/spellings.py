"""Spellings of units in files: ``q1 [deg]``, ``tau1 (N·m)``, ``t_ms``."""

from __future__ import annotations

import re

__all__ = ["current_of", "foreign", "is_current", "is_foreign", "stripped", "suffixed", "unit_behind", "unit_of"]

# Spellings of each unit, by group of columns.
_SPELLINGS = {
    "t": {
        "s": ("s", "sec", "second", "seconds"),
        "ms": ("ms", "msec", "millisecond", "milliseconds"),
        "us": ("us", "µs", "μs", "usec", "microsecond", "microseconds"),
        "ns": ("ns", "nsec", "nanosecond", "nanoseconds"),
    },
    "q": {
        "rad": ("rad", "radian", "radians"),
        "mrad": ("mrad", "milliradian", "milliradians"),
        "deg": ("deg", "°", "º", "degree", "degrees"),
        "turns": ("turn", "turns", "rev", "revs", "revolution", "revolutions"),
        "m": ("m", "meter", "meters", "metre", "metres"),
        "mm": ("mm",),
        "counts": ("count", "counts", "cnt", "cnts", "tick", "ticks"),
    },
    "dq": {
        "rad/s": ("rad/s", "rad/sec", "rads^-1", "rads-1", "rad_s"),
        "mrad/s": ("mrad/s", "mrad/sec", "mrads^-1", "mrads-1", "mrad_s"),
        "rpm": ("rpm", "r/min", "rev/min"),
        "deg/s": ("deg/s", "deg/sec", "°/s", "º/s", "degs^-1", "degs-1", "deg_s"),
        "m/s": ("m/s", "ms^-1", "m_s"),
        "mm/s": ("mm/s", "mms^-1", "mm_s"),
        "counts/s": ("counts/s", "counts/sec", "cnts/s", "ticks/s", "counts_s", "ticks_s"),
    },
    "tau": {
        "Nm": ("Nm", "NM", "nm", "N-m", "newtonmeter", "newton-meter"),
        "mNm": ("mNm", "mnm", "mN-m", "Nmm", "nmm", "N-mm"),
        "Ncm": ("Ncm", "ncm", "N-cm"),
        "kgfcm": ("kgfcm", "kgf-cm", "kgcm", "kg-cm"),
        "N": ("N", "newton"),
        "kN": ("kN",),
    },
}
_UNITS = {word: unit for units in _SPELLINGS.values() for unit, words in units.items() for word in words}
# Spellings that hold in capitals too. Those of torques do not: MNm is no mNm.
_ANY_CASE = {word: unit for word, unit in _UNITS.items() if unit not in _SPELLINGS["tau"] or "newton" in word}
_GROUPS = {unit: group for group, units in _SPELLINGS.items() for unit in units}
# Units of currents, which no factor that is known makes torques of.
_CURRENTS = {"A": ("A", "amp", "amps", "ampere", "amperes"), "mA": ("mA", "milliamp", "milliamps")}
# Words that call a column a current, and those beside which `current` only means the present one: `current_position`.
_CURRENT_WORDS = frozenset({"current", "currents", "curr", "amp", "amps"})
_OTHER_WORDS = frozenset(
    {"torque", "effort", "trq", "tau", "force", "pos", "position", "angle", "vel", "velocity", "speed", "time"}
)
# Text behind the last underscore or blank of a name, which may be a unit; behind the last but one for those of the kind `deg_s`.
_BEHIND = re.compile(r"^.*?[^_\s][_\s]+(?P<unit>[A-Za-z]+_s|[A-Za-zµμ°º%/^·⋅*-]+)$")
# Words that state no unit behind an underscore, for they also are short for something else: `pos_rev`, like all single letters, `torque_A`.
_NO_SUFFIX = frozenset({"rev", "turn", "second", "count", "tick"})
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
    >>> unit_of("N·m"), unit_of("Degrees"), unit_of("MNm"), unit_of("gon")
    ('Nm', 'deg', None, None)
    """
    bare = re.sub(r"[\s·⋅*.]", "", text)
    return _UNITS.get(bare) or _ANY_CASE.get(bare.lower())


def unit_behind(column: str, group: str) -> str | None:
    """Return the unit of a group of columns behind the last underscore or blank of any name; None where there is none, or a word of two meanings.

    Examples
    --------
    >>> unit_behind("torque_mNm", "tau"), unit_behind("elbow speed deg_s", "dq"), unit_behind("pos_ms", "q"), unit_behind("pos_m", "q")
    ('mNm', 'deg/s', None, None)
    """
    match = _BEHIND.match(column)
    if match is None:
        return None
    for text in (match["unit"], match["unit"].rpartition("_")[2]):
        unit = unit_of(text)
        if unit is not None and len(text) > 1 and text.lower() not in _NO_SUFFIX and _GROUPS[unit] == group:
            return unit
    return None


def current_of(column: str) -> str | None:
    """Return the unit of a column of currents, in brackets or behind an underscore or blank; ``""`` for one that only is called so, None for others.

    Examples
    --------
    >>> current_of("Motor Current [mA]"), current_of("i_q mA"), current_of("current_A"), current_of("motorCurrent"), current_of("torque_A")
    ('mA', 'mA', 'A', '', None)
    """
    words = re.split(r"[^a-z]+", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", column).lower())
    called = not _CURRENT_WORDS.isdisjoint(words) and _OTHER_WORDS.isdisjoint(words)
    bracket, behind = _BRACKET.match(column.strip()), _BEHIND.match(column.strip())
    text = (bracket["square"] or bracket["round"]) if bracket else behind["unit"] if behind else ""
    unit = next((unit for unit, spellings in _CURRENTS.items() if text.strip() in spellings), None)
    alone = (
        bracket is not None and bracket["square"] is not None
    )  # any text may stand in round brackets, and a letter behind an underscore
    if unit is not None and (called or alone or len(text) > 1):
        return unit
    return "" if called and unit_behind(column, "tau") is None else None


def is_current(unit: str) -> bool:
    """Return whether a text spells a unit of currents.

    Examples
    --------
    >>> is_current("mA"), is_current("Nm")
    (True, False)
    """
    return any(unit.strip() in spellings for spellings in _CURRENTS.values())


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
    >>> is_foreign("gon"), is_foreign("Nm"), is_foreign("none"), is_foreign("")
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
