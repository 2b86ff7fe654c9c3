"""Base parameters of serial arms: the combinations of parameters that motion determines."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armgap.arm.arm import Arm, checked_arm
from armgap.errors import OptionError

__all__ = ["BaseParameters", "base_parameters"]

#: Number of parameters of a link and its joint: ten inertial parameters, rotor inertia, viscous and Coulomb friction.
PER_JOINT = 13
# Digits of the factors in texts of base parameters, and the share of the largest factor below which a factor is left out.
DIGITS, LEAST = 4, 1e-4


@dataclass(frozen=True)
class BaseParameters:
    """Base parameters of a serial arm: independent parameters, each with the dependent parameters that it combines with.

    With independent columns `Y_b` of the regressor, `Y theta = Y_b (theta_b + K theta_d)`: motion determines only the sum in brackets,
    not its terms.

    Attributes
    ----------
    names, units : tuple of str
        Names of the independent parameters and their SI units, n_base of each.
    columns : tuple of int
        Indices, from 0, of the independent parameters among the arm's parameters; a constant torque of joint j is 13 n_joints + j.
    dependent_names : tuple of str
        Names of the parameters that act only in combinations, or not at all.
    dependent : tuple of int
        Indices of the dependent parameters.
    combination : ndarray, shape (n_base, n_dependent)
        Matrix `K`: derivative of each base parameter by each dependent parameter.
    fixed : tuple of str
        Names of the parameters that keep the arm's value and are not estimated.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    columns: tuple[int, ...]
    dependent_names: tuple[str, ...]
    dependent: tuple[int, ...]
    combination: NDArray[np.float64] = field(repr=False)
    fixed: tuple[str, ...] = ()

    def of(self, theta: ArrayLike) -> NDArray[np.float64]:
        """Return the values of the base parameters for given parameters of the arm.

        Parameters
        ----------
        theta : array_like, shape (13 n_joints,) or (14 n_joints,)
            Parameters as in `Arm.theta`; followed by constant torques of the joints, zero by default.

        Returns
        -------
        ndarray, shape (n_base,)
        """
        values = np.concatenate([np.asarray(theta, dtype=np.float64), np.zeros(len(self.columns))])
        return np.asarray(values[list(self.columns)] + self.combination @ values[list(self.dependent)])

    @property
    def texts(self) -> tuple[str, ...]:
        """Combinations of parameters as texts, one per base parameter, for example ``izz1 + iyy2 + 0.25 mass3``."""
        return tuple(
            _sum(name, self.dependent_names, row) for name, row in zip(self.names, self.combination, strict=True)
        )


def _sum(first: str, names: tuple[str, ...], factors: NDArray[np.float64]) -> str:
    parts, largest = [first], float(np.max(np.abs(factors), initial=1.0))
    for name, factor in zip(names, factors, strict=True):
        size = f"{abs(factor):.{DIGITS}g}"
        if abs(factor) > LEAST * largest:
            parts.append(f"{'-' if factor < 0 else '+'} {'' if size == '1' else size + ' '}{name}")
    return " ".join(parts)


def base_parameters(arm: Arm, *, fixed: Iterable[str] = (), asymmetry: bool = False) -> BaseParameters:
    """Find the base parameters of a serial arm.

    Columns of the torques' regressor over random states are taken from the base outwards; a column is dependent if less than 1e-4 of its
    length is independent of the columns before it (QR): right angles typed with four decimals leave less, a millimetre of geometry more.

    Parameters
    ----------
    arm : Arm
        Serial arm; only its chain is used.
    fixed : iterable of str, optional
        Parameters that are not estimated, by name (``"mass7"``) or, for all joints, by the beginning of the name (``"rotor"``).
    asymmetry : bool, default False
        Add one constant torque per joint.

    Raises
    ------
    OptionError
        If the arm is not serial, or has no parameter of a name in `fixed`.

    References
    ----------
    M. Gautier, Journal of Robotic Systems 8 (1991) 485-506; W. Khalil and E. Dombre, Modeling, Identification and Control of Robots,
    Hermes Penton (2002), section 9.4.
    """
    chain = checked_arm(arm).chain
    if chain is None:
        raise OptionError(
            f"the parameters of an arm of kind `{arm.kind}` are base parameters", remedy="give a serial arm"
        )
    n = chain.n_joints
    names = (*chain.parameter_names, *(f"asymmetry{j + 1}" for j in range(n)))
    units = (*chain.parameter_units, *("N m" if turns else "N" for turns in chain.rotary))
    held = _indices(tuple(fixed), chain.parameter_names)
    count = (PER_JOINT + asymmetry) * n
    candidates = [i for i in range(count) if i not in held]
    columns, dependent, combination = chain.native().base_parameters(candidates)
    return BaseParameters(
        names=tuple(names[i] for i in columns),
        units=tuple(units[i] for i in columns),
        columns=tuple(columns),
        dependent_names=tuple(names[i] for i in dependent),
        dependent=tuple(dependent),
        combination=combination,
        fixed=tuple(names[i] for i in sorted(held)),
    )


def _indices(fixed: tuple[str, ...], names: tuple[str, ...]) -> set[int]:
    """Return the indices of parameters given by name, or by the beginning of their names."""
    found: set[int] = set()
    for name in fixed:
        mine = {i for i, known in enumerate(names) if name in (known, known.rstrip("0123456789"))}
        if not mine:
            raise OptionError(
                f"no parameter is called `{name}`",
                remedy=f"give names such as {names[0]}, or rotor for all joints; all: {', '.join(names)}",
            )
        found |= mine
    return found
