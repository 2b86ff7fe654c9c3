"""The online estimator of the embedded core, updated sample by sample or with arrays of samples."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armgap import _native
from armgap.arm.arm import Arm, checked_arm, kinds
from armgap.errors import OptionError
from armgap.estimation.base_columns import BaseParameters, base_parameters
from armgap.literals import FILTERS, SCHEMES, SERIAL, Filters, Scheme

__all__ = ["OUTCOMES", "Estimator", "Run"]

OUTCOMES: tuple[str, ...] = ("updated", "starting", "rejected")
"""Outcomes of a sample given to the online estimator: estimate updated, too few samples yet for a regression, or sample rejected."""

_FORMS = ("plain", "factorized")


@dataclass(frozen=True)
class Run:
    """Results of the online estimator over many samples, as `Estimator.run` returns them.

    Attributes
    ----------
    theta : ndarray, shape (n_samples, n_parameters)
        Estimate after each sample.
    errors : ndarray, shape (n_samples, n_joints) or (n_samples, 1)
        Prediction errors of each sample; NaN for a sample that was not used.
    outcome : ndarray of uint8, shape (n_samples,)
        Outcome of each sample, as an index into `OUTCOMES`.
    """

    theta: NDArray[np.float64]
    errors: NDArray[np.float64]
    outcome: NDArray[np.uint8]


class Estimator:
    """Recursive estimation of an arm's parameters, as a controller runs it.

    The estimator runs the compiled code of the C library, allocates nothing per sample and gives equal numbers.

    Parameters
    ----------
    arm : Arm or str
        The arm, or its kind: ``"axis"``, ``"pendulum"`` or ``"two-link"``. Of an arm only the kind is used; of a serial arm its chain, and
        the values of fixed parameters. The base parameters of a serial arm are estimated, see `base_parameters`.
    scheme : {"filtered-power", "filtered-dynamic", "supplied-energy"}
        Regression model: equations (30), (24) and (28) of Reyes and Kelly (1997).
    filters : {"exact", "paper"}
        Consistent filters, or those of Reyes and Kelly (1997) as printed.
    cutoff : float, default 50
        Cut-off of the filters [rad/s], in (0, 1e6].
    forgetting : float, default 1
        Forgetting factor in (0, 1]. Forgetting raises no variance above its initial value, so a resting arm does no harm.
    p0 : float, default 1000
        Initial covariance ``P(0) = p0 I``, in (0, 1e12].
    theta0 : array_like, shape (n_parameters,), optional
        Initial parameters ``theta(0)`` [SI], zero by default.
    asymmetry : bool, default False
        Estimate a constant resisting torque per joint too.
    fixed : iterable of str, optional
        Parameters of a serial arm that keep the arm's value, by name (``"mass7"``) or, for all joints, by the beginning of the name (``"rotor"``).
    form : {"plain", "factorized"}, optional
        Form of the covariance: equation (21) as printed, or U D U'. By default plain in double precision with `p0` up to 1e6, factorized
        otherwise.
    single : bool, default False
        Compute in single precision, as on a controller without a unit for doubles.
    memory : float, default 400
        Number of samples over which prediction errors and excitation are averaged, at least 1.
    settling, learning : int, default 400 and 1600
        Number of samples before the alarm learns the size of the prediction errors, and number of samples from which it learns (at least 2).
    between : float, default 1e6
        Mean number of samples between false alarms, at least 10, if prediction errors stay Gaussian and of the size that was learned.
    floor : float, default 0
        Lower limit of the standard deviation of prediction errors that the alarm assumes, in the unit of the errors (N m, W or J).

    Raises
    ------
    OptionError
        If an option has an impossible value.

    References
    ----------
    F. Reyes and R. Kelly, Robotica 15 (1997) 563-571; E. S. Page, Biometrika 41 (1954) 100-115, for the alarm.

    Examples
    --------
    >>> estimator = Estimator("pendulum")
    >>> estimator.update([0.1], [2.0], h=0.0025)
    'starting'
    >>> estimator.theta.tolist()
    [0.0, 0.0, 0.0, 0.0]
    """

    def __init__(
        self,
        arm: Arm | str,
        *,
        scheme: Scheme = "filtered-power",
        filters: Filters = "exact",
        cutoff: float = 50.0,
        forgetting: float = 1.0,
        p0: float = 1000.0,
        theta0: ArrayLike | None = None,
        asymmetry: bool = False,
        fixed: Iterable[str] = (),
        form: Literal["plain", "factorized"] | None = None,
        single: bool = False,
        memory: float = 400.0,
        settling: int = 400,
        learning: int = 1600,
        between: float = 1e6,
        floor: float = 0.0,
    ) -> None:
        kind = arm if isinstance(arm, str) else checked_arm(arm).kind
        for name, value, known in (
            ("arm", kind, (*kinds(), *([] if isinstance(arm, str) else [SERIAL]))),
            ("scheme", scheme, SCHEMES),
            ("filters", filters, FILTERS),
            ("form", form or _FORMS[0], _FORMS),
        ):
            if value not in known:
                raise OptionError(f"`{name}` is {value!r}", remedy=f"known: {', '.join(known)}")
        for name, count in (("settling", settling), ("learning", learning)):
            if not 0 <= count < 2**32:
                raise OptionError(f"`{name}` is {count}", remedy="give a number of samples")
        fixed = tuple(fixed)
        if fixed and kind != SERIAL:
            raise OptionError(
                f"`fixed` is given for an arm of kind `{kind}`", remedy="leave it out, or give a serial arm"
            )
        start = [] if theta0 is None else np.asarray(theta0, dtype=np.float64).ravel().tolist()
        numbers, counts = [cutoff, forgetting, p0, memory, between, floor], [settling, learning]
        paper = filters == "paper"
        self._base = None
        if not isinstance(arm, str) and arm.chain is not None:
            self._base = base_parameters(arm, fixed=fixed, asymmetry=asymmetry)
            self._n_joints, self._names, self._units = arm.n_joints, self._base.names, self._base.units
            chain, columns, values = arm.chain.native(), self._base.columns, self._known(arm)
        else:
            described = kinds()[kind]
            self._n_joints = int(described["n_joints"])
            self._names, self._units = tuple(described["parameter_names"]), tuple(described["parameter_units"])
            if asymmetry:
                self._names += tuple(f"asymmetry{j + 1}" for j in range(self._n_joints))
                self._units += ("N m" if described["rotary"] else "N",) * self._n_joints
        try:
            if self._base is None:
                self._native = _native.Estimator(kind, scheme, paper, form, asymmetry, single, numbers, counts, start)
            else:
                self._native = _native.Estimator.of_chain(
                    chain, columns, values, scheme, paper, form, single, numbers, counts, start
                )
        except ValueError as error:
            raise OptionError(str(error), remedy="see help(armgap.Estimator) for ranges") from None

    def _known(self, arm: Arm) -> list[float]:
        """Return the values of fixed parameters, and zero for dependent parameters, which are estimated as part of combinations."""
        dependent = () if self._base is None else self._base.dependent
        return [0.0 if i in dependent else float(value) for i, value in enumerate(arm.theta)]

    @property
    def base(self) -> BaseParameters | None:
        """Base parameters that the entries of `theta` stand for, for a serial arm; else None."""
        return self._base

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """SI units of the entries of `theta`."""
        return self._units

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`."""
        return self._names

    @property
    def theta(self) -> NDArray[np.float64]:
        """Estimated parameters [SI], shape (n_parameters,)."""
        return self._native.theta

    @property
    def sigma(self) -> NDArray[np.float64]:
        """Standard deviations of the estimated parameters, as if prediction errors were white, shape (n_parameters,)."""
        return self._native.sigma

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance `P` of the parameters for equation errors of unit variance, shape (n_parameters, n_parameters)."""
        return self._native.covariance

    @property
    def errors(self) -> NDArray[np.float64]:
        """Prediction errors of the last used sample [N m, W or J by scheme], shape (n_joints,) or (1,)."""
        return self._native.errors

    @property
    def excitation(self) -> float:
        """Excitation by the recent motion, from 0 (it determines no parameter further) to 1 (it determines every parameter)."""
        return self._native.signals[0]

    @property
    def alarm(self) -> float:
        """Cumulative sum of the test of prediction errors (Page 1954), as a share of its limit: above 1 the model no longer explains the arm."""
        return self._native.signals[1]

    @property
    def updates(self) -> int:
        """Number of samples used by the estimator."""
        return self._native.counts[0]

    @property
    def rejected(self) -> int:
        """Number of rejected samples: not finite, of impossible size, not later than the previous one, or unusable by least squares."""
        return self._native.counts[1]

    def update(
        self,
        q: ArrayLike,
        tau: ArrayLike,
        dq: ArrayLike | None = None,
        *,
        t: float | None = None,
        h: float | None = None,
    ) -> str:
        """Update the estimate with one sample.

        Parameters
        ----------
        q : array_like, shape (n_joints,)
            Positions [rad or m].
        tau : array_like, shape (n_joints,)
            Torques that act until the next sample [N m or N].
        dq : array_like, shape (n_joints,), optional
            Velocities [rad/s or m/s]; given with every sample or with none.
        t, h : float
            Time [s], or period since the last sample [s]; give one of the two.

        Returns
        -------
        str
            One of `OUTCOMES`; a sample that cannot be used is rejected, not an error.

        Raises
        ------
        OptionError
            If an array has a wrong shape, or neither or both of `t` and `h` are given.
        """
        if (t is None) == (h is None):
            raise OptionError("a sample needs its time or its period", remedy="give `t` or `h`")
        when = float(t if h is None else h)  # type: ignore[arg-type]
        velocity = None if dq is None else self._vector("dq", dq)
        return OUTCOMES[
            self._native.update(when, h is not None, self._vector("q", q), velocity, self._vector("tau", tau))
        ]

    def run(
        self,
        q: ArrayLike,
        tau: ArrayLike,
        dq: ArrayLike | None = None,
        *,
        t: ArrayLike | None = None,
        h: ArrayLike | None = None,
    ) -> Run:
        """Update the estimate with many samples; the interpreter lock is released, and contiguous float64 arrays are not copied.

        Parameters
        ----------
        q, tau : array_like, shape (n_samples, n_joints)
            Positions, and torques that act until the next sample.
        dq : array_like, shape (n_samples, n_joints), optional
            Velocities.
        t, h : array_like, shape (n_samples,)
            Times [s], or periods since the sample before [s] (or one number for all samples); give one of the two.

        Returns
        -------
        Run

        Raises
        ------
        OptionError
            If shapes do not fit, or neither or both of `t` and `h` are given.
        """
        if (t is None) == (h is None):
            raise OptionError("samples need their times or their periods", remedy="give `t` or `h`")
        positions = self._matrix("q", q, None)
        count = len(positions)
        when = np.asarray(t if h is None else h, dtype=np.float64)
        when = np.ascontiguousarray(np.broadcast_to(when, (count,)) if when.ndim == 0 and h is not None else when)
        if when.shape != (count,):
            raise OptionError(f"`{'h' if t is None else 't'}` has shape {when.shape}", remedy=f"give {count} values")
        velocity = None if dq is None else self._matrix("dq", dq, count)
        torque = self._matrix("tau", tau, count)
        return Run(*self._native.run(when, h is not None, positions, velocity, torque))

    def copy(self) -> Estimator:
        """Return an independent estimator in the same state: a checkpoint."""
        twin = object.__new__(Estimator)
        twin.__dict__.update(self.__dict__)
        twin._native = self._native.copy()
        return twin

    def _vector(self, name: str, x: ArrayLike) -> NDArray[np.float64]:
        array = np.ascontiguousarray(x, dtype=np.float64)
        if array.shape != (self._n_joints,):
            raise OptionError(f"`{name}` has shape {array.shape}", remedy=f"give {self._n_joints} values")
        return array

    def _matrix(self, name: str, x: ArrayLike, count: int | None) -> NDArray[np.float64]:
        array = np.ascontiguousarray(x, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != self._n_joints or count not in (None, len(array)):
            rows = "n_samples" if count is None else count
            raise OptionError(
                f"`{name}` has shape {array.shape}", remedy=f"give an array of shape ({rows}, {self._n_joints})"
            )
        return array
