"""Columns that are named after the joints of a serial arm."""

from __future__ import annotations

from collections.abc import Container
from typing import TYPE_CHECKING

from armgap.errors import ColumnError
from armgap.log.conversion.index import QUANTITIES, Index
from armgap.log.findings import Finding

if TYPE_CHECKING:
    from armgap.arm.arm import Arm

__all__ = ["named_after_joints"]


def named_after_joints(index: Index, arm: Arm | None, given: Container[str]) -> tuple[dict[str, str], list[Finding]]:
    """Return columns named after the joints of a chain, by standard name, and findings on standard names that they stand in the place of.

    A quantity is read by the joints' names if every joint has its column, or if no column has a standard name: then errors name those that are
    missing. Standard names `given` otherwise, by options or the arm file, are left to these.

    Raises
    ------
    ColumnError
        If all joints have a quantity's columns both by the joints' names and by standard names.
    """
    names: dict[str, str] = {}
    findings: list[Finding] = []
    if arm is None or arm.chain is None:
        return names, findings
    for key, quantity in QUANTITIES.items():
        mapped = {f"{key}{j}": f"{joint}/{quantity}" for j, joint in enumerate(arm.chain.joint_names, start=1)}
        there = [column for column, name in mapped.items() if index.find(name, column) is not None]
        standard = [column for column in mapped if column in index.recording.columns]
        open_names = [column for column in standard if column not in given]
        if not there or (standard and len(there) < len(mapped)):
            continue
        if open_names and len(standard) == len(mapped):
            column = open_names[0]
            raise ColumnError(
                f"stands beside `{mapped[column]}`, and both are of joint {column[len(key) :]}",
                remedy=f"say which one with --columns {column}={column} or --columns {column}={mapped[column]}, for all joints",
                file=index.place,
                column=column,
            )
        if open_names:
            said = ", ".join(f"`{column}`" for column in open_names)
            findings.append(Finding("columns", f"not used: {said}, as all joints have their {quantity} by name"))
        names |= mapped
    return names, findings
