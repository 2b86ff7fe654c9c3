"""From the file of a description to a chain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from armgap.description.resolved import ResolvedModel

__all__ = ["read_description"]


def read_description(
    path: Path, *, base: str | None, tip: str | None, frozen: Mapping[str, float], mjcf: bool | None = None
) -> ResolvedModel:
    """Read a URDF or MJCF file."""
    raise NotImplementedError
