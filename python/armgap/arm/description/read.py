"""Reading of a URDF or MJCF file as a serial chain."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from armgap.arm.description.resolve import resolve
from armgap.arm.description.resolved import ResolvedModel
from armgap.arm.description.tree import Tree
from armgap.arm.description.urdf import urdf_tree
from armgap.arm.description.xml import parse, read_text
from armgap.errors import ModelFileError

__all__ = ["read_description", "read_tree"]

_ROOT = re.compile(rb"<\s*([A-Za-z_][\w:.-]*)")
_ASIDE = re.compile(rb"<!--.*?-->|<\?.*?\?>|<!DOCTYPE[^>]*>", re.DOTALL)
_FOUND = {"robot": "URDF", "mujoco": "MJCF"}


def read_description(
    path: Path, *, base: str | None, tip: str | None, frozen: Mapping[str, float], expected: str | None = None
) -> ResolvedModel:
    """Read a URDF or MJCF file, recognised by its first element, and resolve it to a chain.

    Parameters
    ----------
    path : Path
        File.
    base, tip, frozen
        First and last link of the chain (None for the default), and positions of joints that stand still [rad or m], as for `resolve`.
    expected : {"URDF", "MJCF"}, optional
        Format that the caller states.

    Raises
    ------
    ModelFileError
        If the file cannot be read or has no chain from `base` to `tip`.
    OptionError
        If the file is MJCF and MuJoCo is not installed.
    """
    return resolve(read_tree(path, expected), base=base, tip=tip, frozen=frozen)


def read_tree(path: Path, expected: str | None = None) -> Tree:
    """Read a URDF or MJCF file as a tree of links and joints; `expected`, if given, is the format that the caller states."""
    data = read_text(path)
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        first = parse(data, path).tag
    else:
        match = _ROOT.search(_ASIDE.sub(b"", data))
        first = "" if match is None else match[1].decode("ascii", "replace")
    found = _FOUND.get(first)
    if found is None:
        what = f"begins with <{first}>" if first else "is no XML"
        remedy = "convert it to URDF first" if first == "sdf" else "give a URDF (<robot>) or an MJCF model (<mujoco>)"
        raise ModelFileError(f"{what} and is no description of a robot", remedy=remedy, file=path)
    if expected not in (None, found):
        raise ModelFileError(f"is {found}, not {expected}", remedy=f"write {found.lower()} = ... instead", file=path)
    if found == "MJCF":
        from armgap.arm.description.mjcf import mjcf_tree

        return mjcf_tree(path)
    return urdf_tree(parse(data, path), path)
