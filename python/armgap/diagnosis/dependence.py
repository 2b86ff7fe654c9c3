"""Torques without a name: what the residual torque that stays depends on, as tables over one or two variables of the motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

__all__ = ["Dependence", "DependenceGrid", "DependenceLaw", "dependence"]


@dataclass(frozen=True)
class DependenceLaw:
    """Residual torque of a joint as a table over a variable.

    Attributes
    ----------
    x : tuple of float
        Mean of the variable in each class, rising.
    torque, sigma : tuple of float
        Torque in each class less the mean torque, and its standard deviation [N m or N].
    """

    x: tuple[float, ...]
    torque: tuple[float, ...]
    sigma: tuple[float, ...]


@dataclass(frozen=True)
class DependenceGrid:
    """Residual torque of a joint as a table over two variables.

    Attributes
    ----------
    variable, unit : str
        Second variable, named as the first, and its unit.
    x, y : tuple of float
        Means of the first and of the second variable in their classes, rising.
    torque, sigma : tuple of tuple of float
        Torque in each class of the first variable (rows) and of the second (columns) less the mean torque, and its standard deviation [N m or
        N]. Cells that no sample lies in have torques by the table's smoothness; their standard deviations are too small.
    """

    variable: str
    unit: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    torque: tuple[tuple[float, ...], ...]
    sigma: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Dependence:
    """Variable, or pair of variables, on which the part of a joint's residual torque depends that no named effect explains.

    Attributes
    ----------
    joint : int
        Joint that the torque acts on, from 1.
    variable, unit : str
        ``"q1"``, ``"dq1"``, ``"ddq1"``, ``"tau1"`` and so on, or ``"t"``, the time since the log began, and its unit; of two variables the one
        that alone predicts more.
    share : float
        Share of the residual torque's variance beyond noise that the table (of both variables, where there are two) predicts in logs that it was
        not fitted to, 0 to 1.
    law : DependenceLaw
        Torque over the variable, an unnamed law that may differ for another arm, load or motion.
    grid : DependenceGrid or None
        Torque over the variable and a second one; None where the torque depends on one variable.
    """

    joint: int
    variable: str
    unit: str
    share: float
    law: DependenceLaw
    grid: DependenceGrid | None = None


def dependence(data: dict[str, Any]) -> Dependence:
    """Return an entry of a diagnosis' ``unnamed`` as it is read from JSON."""
    law = {key: tuple(data["law"][key]) for key in ("x", "torque", "sigma")}
    grid = data.get("grid")
    if grid is not None:
        torque, sigma = (tuple(map(tuple, grid[key])) for key in ("torque", "sigma"))
        grid = DependenceGrid(grid["variable"], grid["unit"], tuple(grid["x"]), tuple(grid["y"]), torque, sigma)
    return Dependence(data["joint"], data["variable"], data["unit"], data["share"], DependenceLaw(**law), grid)
