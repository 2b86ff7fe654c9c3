"""Data of a case that a defect changes: tables of samples and an arm file as a dictionary; and the true arm."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Indices of the gravity terms among the inertial parameters, by kind of arm.
GRAVITY_TERMS = {"axis": (1,), "pendulum": (1,), "two-link": (3, 4)}


class NotApplicableError(Exception):
    """Exception for a defect that a case cannot have, or that would be no defect in that case."""


@dataclass(frozen=True)
class Table:
    """Samples of one log, with the true motion.

    Attributes
    ----------
    t : ndarray, shape (n_samples,)
        Time stamps [s].
    q, tau : ndarray, shape (n_samples, n_joints)
        Positions [rad or m] and torques [N m or N] as the log has them.
    q_true, dq_true : ndarray, shape (n_samples, n_joints)
        True positions and velocities, which are not in the log [rad or m, and per second].
    """

    t: Array
    q: Array
    tau: Array
    q_true: Array
    dq_true: Array

    def column(self, name: str) -> Array:
        """Return one column of the log by its name, ``q1``, ``tau2`` and so on."""
        group, index = _split(name)
        values: Array = getattr(self, group)[:, index]
        return values

    def with_column(self, name: str, values: Array) -> Table:
        """Return the table with other values in one column."""
        group, index = _split(name)
        block = getattr(self, group).copy()
        block[:, index] = values
        return self.changed(**{group: block})

    def changed(self, **groups: Array) -> Table:
        """Return the table with other values in ``t``, ``q`` or ``tau``."""
        return replace(self, **groups)

    def rows(self, rows: slice) -> Table:
        """Return the table of a slice of the rows, with unchanged time stamps."""
        return Table(*(getattr(self, name)[rows] for name in ("t", "q", "tau", "q_true", "dq_true")))

    def frame(self) -> pl.DataFrame:
        """Return the columns of the log as they are written to its file."""
        columns = {"t": self.t}
        for group in ("q", "tau"):
            columns |= {f"{group}{j + 1}": x for j, x in enumerate(getattr(self, group).T)}
        return pl.DataFrame(columns)


def _split(name: str) -> tuple[str, int]:
    return name.rstrip("0123456789"), int(name[-1]) - 1


@dataclass(frozen=True)
class Inputs:
    """Inputs of a diagnosis: training logs and holdout logs by name, and the arm file as a dictionary."""

    training: Mapping[str, Table]
    holdout: Mapping[str, Table]
    arm: Mapping[str, Any]

    def each(self, change: Callable[[Table], Table], where: str = "both") -> Inputs:
        """Return the inputs with `change` applied to every log of both groups (``"both"``), of ``"training"`` or of ``"holdout"``."""

        def group(name: str, logs: Mapping[str, Table]) -> dict[str, Table]:
            return {k: change(x) if where in ("both", name) else x for k, x in logs.items()}

        return replace(self, training=group("training", self.training), holdout=group("holdout", self.holdout))

    def one(self, name: str, change: Callable[[Table], Table]) -> Inputs:
        """Return the inputs with `change` applied to one log."""

        return self.with_log(name, change(self.logs[name]))

    def with_log(self, name: str, table: Table) -> Inputs:
        """Return the inputs with another table in the place of one log."""

        def group(logs: Mapping[str, Table]) -> dict[str, Table]:
            return {k: table if k == name else x for k, x in logs.items()}

        return replace(self, training=group(self.training), holdout=group(self.holdout))

    @property
    def logs(self) -> dict[str, Table]:
        """Tables of all logs, training and holdout, by name."""
        return {**self.training, **self.holdout}

    def with_arm(self, table: str, **values: Any) -> Inputs:
        """Return the inputs with other values in one table of the arm file; the logs are unchanged."""
        return replace(self, arm={**self.arm, table: {**self.arm[table], **values}})


@dataclass(frozen=True)
class Truth:
    """True arm of a case, which the diagnosis is not told.

    Attributes
    ----------
    model, kind : str
        Name of the trial's arm model, and kind of its arm file.
    theta : ndarray, shape (n_parameters,)
        True parameters: inertial, then viscous, then Coulomb.
    step, limit : ndarray, shape (n_joints,)
        Encoder steps [rad or m] and torque limits [N m or N].
    period : float
        Sample period [s].
    """

    model: str
    kind: str
    theta: Array
    step: Array
    limit: Array
    period: float

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.step)

    @property
    def inertial(self) -> Array:
        """True inertial parameters."""
        return self.theta[: len(self.theta) - 2 * self.n_joints]

    @property
    def weighs(self) -> bool:
        """Whether gravity acts along any joint."""
        return bool(np.any(self.inertial[list(GRAVITY_TERMS[self.kind])] != 0))

    def gravity(self, q: Array) -> Array:
        """Return the gravity torques at the given positions [N m or N], shape (n_samples, n_joints)."""
        theta = self.inertial
        if self.kind == "axis":
            return np.full_like(q, theta[1])
        if self.kind == "pendulum":
            return np.asarray(theta[1] * np.sin(q))
        outer = theta[4] * np.sin(q[:, 0] + q[:, 1])
        return np.column_stack([theta[3] * np.sin(q[:, 0]) + outer, outer])


def toml(arm: Mapping[str, Any]) -> str:
    """Return the TOML text of an arm file."""
    scalars = {k: v for k, v in arm.items() if not isinstance(v, Mapping)}
    tables = {k: v for k, v in arm.items() if isinstance(v, Mapping)}
    lines = [f"{k} = {_value(v)}" for k, v in scalars.items()]
    for name, table in tables.items():
        lines += ["", f"[{name}]", *(f"{k} = {_value(v)}" for k, v in table.items())]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return repr([float(x) for x in value]) if isinstance(value, list | np.ndarray) else repr(value)
