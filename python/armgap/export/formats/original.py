"""Writing of corrected parameters into the user's own URDF or MJCF description, whose other content stays."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armgap.arm.description.read import read_tree
from armgap.arm.description.resolve import Carried, locate
from armgap.arm.description.tree import Tree
from armgap.arm.rigid_body import moved
from armgap.export.chain.serial import CorrectedSerial
from armgap.export.corrected import Corrected
from armgap.export.errors import ExportError

__all__ = ["CorrectedDescription", "into_description"]

Array = NDArray[np.float64]

#: Difference of inertial parameters, relative to the largest, below which the description's own numbers stay.
_ROUNDING = 1e-12
_RELATIVE_FILE = re.compile(rb"\s(?:filename|file)\s*=\s*[\"'](?!/|[a-z]+:)")


@dataclass(frozen=True)
class CorrectedDescription:
    """A URDF or MJCF description with corrected parameters.

    Attributes
    ----------
    form : {"urdf", "mjcf"}
        Format of the file.
    content : bytes
        Content of the file.
    remarks : tuple of str
        Remarks on the file, one line each.
    """

    form: str
    content: bytes
    remarks: tuple[str, ...]

    @property
    def names_files(self) -> bool:
        """Whether the description refers to files, such as meshes, by relative paths."""
        return _RELATIVE_FILE.search(self.content) is not None


def into_description(
    model: Corrected, path: str | os.PathLike[str], *, frozen: Mapping[str, float] | None = None
) -> CorrectedDescription:
    """Write corrected parameters into the description that the arm file was made from.

    Of the description's links that are fixed to each other and form one link of the arm, the heaviest takes the correction; the others keep
    their inertias. Friction, and all effects for which the format has a field, are written to the joints.

    Parameters
    ----------
    model : CorrectedSerial
        Corrected model of a serial arm.
    path : path-like
        URDF or MJCF file with the arm's joints.
    frozen : mapping of str to float, optional
        Positions of joints that stand still [rad or m], as they were given when the arm file was made.

    Returns
    -------
    CorrectedDescription

    Raises
    ------
    ModelFileError
        If the file cannot be read, or is of another arm.
    ExportError
        If the arm is planar, or a link's inertia has no place in the description.
    OptionError
        If the file is MJCF and MuJoCo is not installed.
    """
    path = Path(path)
    if not isinstance(model, CorrectedSerial):
        raise ExportError(
            f"arms of kind `{model.arm.kind}` have no description to be corrected",
            remedy="leave out --model",
            file=path,
        )
    tree = read_tree(path)
    located = locate(tree, model.chain, frozen or {})
    takers = [_heaviest(tree, carried) for carried in located.carried]
    rest = [
        sum((_in_place(tree.links[b.link], b) for b in carried if b is not taker), np.zeros(10))
        for taker, carried in zip(takers, located.carried, strict=True)
    ]
    model = model.beside(np.array(rest))
    inertial = {}
    for taker, total, others in zip(takers, model.bodies.inertial, rest, strict=True):
        ten = moved(total - others, taker.rotation.T, -taker.rotation.T @ taker.translation)
        was = tree.links[taker.link]
        if np.max(np.abs(ten - was)) > _ROUNDING * np.max(np.abs(was)):
            inertial[taker.link] = ten
    if tree.format == "URDF":
        from armgap.export.formats.original_urdf import write_urdf

        return CorrectedDescription("urdf", *write_urdf(model, path, located, inertial))
    from armgap.export.formats.original_mjcf import write_mjcf

    return CorrectedDescription("mjcf", *write_mjcf(model, tree, located, inertial))


def _heaviest(tree: Tree, carried: tuple[Carried, ...]) -> Carried:
    """Return the description link that takes the correction: the first of the heaviest links fixed to the chain's link."""
    rigid = [body for body in carried if body.rigid]
    if not rigid:
        raise ExportError(
            "the description has no body for a link of the arm",
            remedy="give each joint a body of its own",
            file=tree.file,
        )
    return max(rigid, key=lambda body: float(tree.links[body.link][0]))


def _in_place(ten: Array, body: Carried) -> Array:
    return moved(ten, body.rotation, body.translation)
