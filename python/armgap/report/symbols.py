"""Words for variables of the motion."""

from __future__ import annotations

import re
from typing import Any

__all__ = ["depends_text", "symbol_text"]

_SYMBOLS = {"q": "position", "dq": "speed", "ddq": "acceleration", "tau": "torque"}
_SYMBOL = re.compile(r"(q|dq|ddq|tau)[0-9]+")


def depends_text(entry: dict[str, Any]) -> str:
    """Return what a torque without a name depends on: the symbol of its variable, or of both.

    Parameters
    ----------
    entry : dict
        One entry of a diagnosis' ``unnamed``.
    """
    grid = entry.get("grid")
    return " and ".join(symbol_text(d["variable"]) for d in (entry, grid) if d)


def symbol_text(variable: str) -> str:
    """Return the meaning of a variable such as ``dq2``; any other text unchanged.

    Examples
    --------
    >>> symbol_text("ddq2"), symbol_text("rate of change of tau1"), symbol_text("t")
    ('acceleration of joint 2', 'rate of change of the torque of joint 1', 'time')
    """
    words = variable.split(" ")
    symbol = next((w for w in words if _SYMBOL.fullmatch(w)), None)
    if symbol is None:
        return "time" if variable == "t" else variable
    stem = symbol.rstrip("0123456789")
    meaning = f"{_SYMBOLS[stem]} of joint {symbol[len(stem) :]}"
    return " ".join(
        (meaning if len(words) == 1 or w != words[-1] else f"the {meaning}") if w == symbol else w for w in words
    )
