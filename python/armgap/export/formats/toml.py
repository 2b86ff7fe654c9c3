"""Export to an arm file with the corrected parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from armgap import _native
from armgap.export.corrected import LEAST_SIGMA
from armgap.export.formats import header

if TYPE_CHECKING:
    from armgap.diagnosis.result import Value
    from armgap.export.corrected import Corrected

__all__ = ["render"]


def render(model: Corrected) -> str:
    """Return the text of an arm file; effects for which arm files have no field stand in its head as a command ``armgap simulate``."""
    head = [f"# {line}" for line in header.lines(model, "toml")]
    head.append(f"# sigma: the estimate's, but at least {LEAST_SIGMA:.0%} of the value")
    library = {effect["name"] for effect in _native.effects()}
    options = [
        _option(c.effect, c.joint, c.parameters)
        for c in model.causes
        if model.field_of(c, "toml") is None and not c.row and c.effect in library
    ]
    head += [f"# armgap simulate --arm THIS.toml --torque LOG -o OUT.parquet {' '.join(options)}"] if options else []
    return "\n".join(head) + "\n" + model.nominal().to_toml()


def _option(effect: str, joint: int | None, parameters: Mapping[str, Value]) -> str:
    pairs = ",".join(f"{name}={value.value!r}" for name, value in parameters.items())
    return f"--effect {effect}:{'' if joint is None else joint}:{pairs}"
