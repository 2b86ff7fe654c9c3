"""Model of an arm (`Arm`): nominal parameters with standard deviations, limits, chain, controller and corrections of logs."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.errors import OptionError
from armgap.literals import SERIAL, Side, TauKind
from armgap.options import not_an_arm, positive

if TYPE_CHECKING:
    from armgap.arm.controller import Controller
    from armgap.arm.corrections import Corrections
    from armgap.arm.free_space import FreeSpace
    from armgap.arm.serial.chain import SerialChain

__all__ = ["Arm", "MotionLimits", "arm_of", "checked_arm", "kinds", "listed", "only_planar", "quoted"]


@dataclass(frozen=True)
class MotionLimits:
    """Limits of position, speed and acceleration for planned motions of an arm; limits of torque are `Arm.torque_limit`.

    Attributes
    ----------
    position_min, position_max : ndarray, shape (n_joints,)
        Range of positions [rad or m].
    speed, acceleration : ndarray, shape (n_joints,)
        Largest speed [rad/s or m/s] and acceleration [rad/s^2 or m/s^2].
    space : FreeSpace, optional
        Shapes of the links, and obstacles that the links must not touch.
    """

    position_min: NDArray[np.float64]
    position_max: NDArray[np.float64]
    speed: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    space: FreeSpace | None = None

    def toml_lines(self) -> list[str]:
        """Return the limits as the lines of an arm file's table ``[limits]``, without the links' lengths."""
        names = ("position_min", "position_max", "speed", "acceleration")
        lines = [f"{name} = {listed(getattr(self, name))}" for name in names]
        if self.space is not None:
            boxes = ", ".join(listed(box) for box in self.space.boxes)
            lines += [f"link_radius = {listed(self.space.link_radius)}", f"boxes = [{boxes}]"]
        return ["[limits]", *lines]


@dataclass(frozen=True)
class Arm:
    """The nominal model of an arm.

    Attributes
    ----------
    name : str
        Name of the arm in reports.
    kind : str
        ``"axis"``, ``"pendulum"``, ``"two-link"`` or ``"serial"``.
    gravity : float
        Acceleration of gravity [m/s^2].
    sample_period : float
        Nominal sample period [s].
    theta, sigma : array_like, shape (n_parameters,)
        Inertial base parameters, then viscous, then Coulomb coefficients per joint [SI], and the standard deviation of each. The inertial parameters
        of a serial arm are ten per link, see `armgap.arm.rigid_body`, then the rotors' inertias at the joints.
    counts_per_rev : array_like, shape (n_joints,), optional
        Encoder counts per turn of the joint, also for an encoder at the motor (per metre on a linear joint).
    torque_limit : array_like, shape (n_joints,), optional
        Torque limit [N m].
    link_length : array_like, shape (n_joints,), optional
        Link lengths [m].
    link_mass : array_like, shape (n_joints,), optional
        Link masses [kg]; not identifiable from motion, but needed by an export to a simulator.
    encoder_side, friction_side : tuple of {"motor", "link", "unknown"}, optional
        Per joint, the side of the transmission that the encoder measures and that friction acts on. For ``"unknown"``, an elastic or
        slack transmission is tried with both sides.
    gear_ratio : array_like, shape (n_joints,), optional
        Turns of the motor per turn of the joint.
    columns : dict of str to str
        Names that the arm's logs use for ``t``, ``q1``, ``tau1`` and so on.
    sealed : str, optional
        SHA-256 of the key of a blind trial (the hidden effects of the arm's logs).
    path : Path, optional
        File that the arm was read from.
    corrections : Corrections, optional
        Corrections of the columns of the arm's logs: signs, zeros, units, order.
    limits : MotionLimits, optional
        Limits that a planned motion keeps to.
    chain : SerialChain, optional
        Joints of a serial arm with their placements, and gravity as a vector.
    controller : Controller, optional
        Position controller that tracks a planned motion; logs may hold its references in place of torques.
    tau_kind : {"command", "measured"}
        Whether logged torques are commands, held until the next sample, or measured torques, interpolated between samples.
    notes : tuple of str
        Remarks from reading the robot's description.

    Raises
    ------
    OptionError
        If the kind is not known, a serial arm has no chain or another kind has one, or an array does not have one finite number per parameter or
        joint; the message names the known kinds, or the arm's parameters in their order.

    Examples
    --------
    >>> arm = Arm("bench", "pendulum", 9.81, 0.004, [0.05, 0.6, 0.02, 0.1], sigma=[0.01, 0.1, 0.01, 0.05])
    >>> arm.parameter_names
    ('theta1', 'theta2', 'viscous1', 'coulomb1')
    """

    name: str
    kind: str
    gravity: float
    sample_period: float
    theta: NDArray[np.float64]
    sigma: NDArray[np.float64]
    counts_per_rev: NDArray[np.float64] | None = None
    torque_limit: NDArray[np.float64] | None = None
    link_length: NDArray[np.float64] | None = None
    columns: dict[str, str] = field(default_factory=dict)
    sealed: str | None = None
    path: Path | None = None
    link_mass: NDArray[np.float64] | None = None
    encoder_side: tuple[Side, ...] | None = None
    friction_side: tuple[Side, ...] | None = None
    gear_ratio: NDArray[np.float64] | None = None
    corrections: Corrections | None = None
    limits: MotionLimits | None = None
    chain: SerialChain | None = None
    controller: Controller | None = None
    tau_kind: TauKind = "command"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Make arrays of the numbers, and check that kind, chain and numbers of the arm are consistent with each other."""
        if not isinstance(self.kind, str) or self.kind not in (*kinds(), SERIAL):
            from armgap.arm.arm_file import suggest

            raise OptionError(f"`{self.kind}` is not a kind of arm", remedy=suggest(str(self.kind), [*kinds(), SERIAL]))
        if (self.kind == SERIAL) != (self.chain is not None):
            raise OptionError(
                f"an arm of kind `{self.kind}` and its chain do not fit", remedy='give kind "serial" a chain'
            )
        positive(self.sample_period, "arm's sample period")
        n = self.n_joints
        every = f"{self.n_inertial + 2 * n}: {self._parameters_in_words()}"
        self._make_array("theta", self.n_inertial + 2 * n, every, np.isfinite, "finite numbers")
        self._make_array("sigma", self.n_inertial + 2 * n, every, lambda x: x >= 0, "numbers from 0")
        for name in ("counts_per_rev", "torque_limit", "link_mass", "gear_ratio", "link_length"):
            if getattr(self, name) is not None:
                fits = (lambda x: x >= 0) if name == "link_length" else (lambda x: x > 0)
                self._make_array(name, n, f"{n}, one per joint", fits, "numbers above 0")

    def _make_array(
        self, name: str, count: int, wanted: str, fits: Callable[[NDArray[np.float64]], Any], which: str
    ) -> None:
        """Make an array of the numbers in a field; raise unless there are `count` of them, all finite and of the kind that `fits` accepts."""
        given = getattr(self, name)
        try:
            values = np.asarray(given, dtype=np.float64)
        except (TypeError, ValueError):
            values = np.empty(())
        if values.ndim == 0:
            raise OptionError(f"{name} is {given!r}"[:120], remedy=f"give {wanted}")
        if values.shape != (count,):
            found = f"{len(values)} entries" if values.ndim == 1 else f"the shape {values.shape}"
            raise OptionError(f"{name} has {found}", remedy=f"give {wanted}")
        for i in np.flatnonzero(~(np.isfinite(values) & fits(values)))[:1]:
            raise OptionError(f"{name} holds {values[i]:g} at entry {i + 1}", remedy=f"give {which}")
        object.__setattr__(self, name, values)

    def _parameters_in_words(self) -> str:
        """Return what the entries of `theta` are, in their order."""
        if self.chain is not None:
            return "ten per link, then rotor, viscous and Coulomb per joint"
        named = zip(self.parameter_names, self.parameter_units, strict=True)
        return ", ".join(f"{name} [{unit}]" for name, unit in named)

    @classmethod
    def read(cls, path: str | Path) -> Arm:
        """Read and check an arm file.

        Parameters
        ----------
        path : path-like
            TOML file.

        Raises
        ------
        ArmFileError
            If the file is missing, not TOML, or describes no possible arm; the message names the key.
        """
        from armgap.arm.arm_file import ArmFile

        arm = cls(**ArmFile.load(Path(path)).fields())
        return arm if arm.corrections is None else arm.corrections.on_arm(arm)

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return int(self._kind["n_joints"]) if self.chain is None else self.chain.n_joints

    @property
    def n_inertial(self) -> int:
        """Number of inertial base parameters; for a serial arm ten per link and one per rotor."""
        return int(self._kind["n_inertial"]) if self.chain is None else 11 * self.chain.n_joints

    @property
    def rotary(self) -> bool:
        """Whether all joint positions of the arm are angles, not lengths."""
        return all(self.rotary_joints)

    @property
    def rotary_joints(self) -> tuple[bool, ...]:
        """Whether the position of each joint is an angle."""
        if self.chain is not None:
            return self.chain.rotary
        return (bool(self._kind["rotary"]),) * self.n_joints

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`: parameters of the arm, such as ``theta1`` or ``mass1``."""
        return tuple(self._kind["parameter_names"]) if self.chain is None else self.chain.parameter_names

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """SI units of the entries of `theta`, the parameters of the arm."""
        return tuple(self._kind["parameter_units"]) if self.chain is None else self.chain.parameter_units

    @property
    def gravity_parameters(self) -> NDArray[np.intp]:
        """Indices into `theta` of gravity torques or forces [N m or N]; empty for a serial arm."""
        if self.chain is not None:
            return np.empty(0, dtype=np.intp)
        weight = "N m" if self.rotary else "N"
        return np.array([i for i in range(self.n_inertial) if self.parameter_units[i] == weight], dtype=np.intp)

    @property
    def expects_weight(self) -> bool:
        """Whether the gravity parameters in `theta` are those of an arm that hangs down at position 0: none negative, at least one positive."""
        weights = self.theta[self.gravity_parameters]
        return bool(np.all(weights >= 0) and np.any(weights > 0))

    @property
    def _kind(self) -> dict[str, Any]:
        return kinds()[self.kind]

    @property
    def encoder_step(self) -> NDArray[np.float64] | None:
        """Position step of one encoder count [rad or m], shape (n_joints,)."""
        if self.counts_per_rev is None:
            return None
        return np.where(self.rotary_joints, 2 * np.pi, 1.0) / self.counts_per_rev

    def _repr_html_(self) -> str:
        """Return kind, conventions and parameters of the arm as HTML for a notebook."""
        from armgap.report.forms.shown import arm_facts

        return arm_facts(self).html()

    def _repr_markdown_(self) -> str:
        """Return kind, conventions and parameters of the arm as Markdown."""
        from armgap.report.forms.shown import arm_facts

        return arm_facts(self).markdown()

    def to_native(self) -> dict[str, Any]:
        """Return the arm as the dict that the compiled core reads."""

        def as_list(x: NDArray[np.float64] | None) -> list[float] | None:
            return None if x is None else [float(v) for v in x]

        chain: dict[str, Any] = {} if self.chain is None else {"chain": self.chain.to_native()}
        if self.chain is not None and self.controller is not None:
            chain["controller"] = self.controller.to_native()
        return {
            "kind": self.kind,
            "gravity": self.gravity,
            "theta": as_list(self.theta),
            "sigma": as_list(self.sigma),
            "counts_per_rev": as_list(self.counts_per_rev),
            "torque_limit": as_list(self.torque_limit),
            "link_length": as_list(self.link_length),
            "encoder_at_motor": _at_motor(self.encoder_side),
            "friction_at_motor": _at_motor(self.friction_side),
            "gear_ratio": as_list(self.gear_ratio),
            **chain,
        }

    def to_toml(self) -> str:
        """Return the text of an arm file for this arm; for a serial arm the text holds the chain and refers to no other file."""
        if self.chain is not None:
            from armgap.arm.serial.toml import serial_toml

            return serial_toml(self)
        n, b = self.n_joints, self.n_inertial
        lines = [
            f"name = {quoted(self.name)}",
            f"kind = {quoted(self.kind)}",
            f"gravity = {self.gravity!r}",
            f"sample_period = {self.sample_period!r}",
            "",
            "[inertial]",
            f"theta = {listed(self.theta[:b])}",
            f"sigma = {listed(self.sigma[:b])}",
            "",
            "[friction]",
            f"viscous = {listed(self.theta[b : b + n])}",
            f"coulomb = {listed(self.theta[b + n :])}",
            f"sigma_viscous = {listed(self.sigma[b : b + n])}",
            f"sigma_coulomb = {listed(self.sigma[b + n :])}",
        ]
        return "\n".join([*lines, *self.table_lines()]) + "\n"

    def table_lines(self) -> list[str]:
        """Return the lines of an arm file that all kinds of arm have: encoders, transmissions, limits, columns and corrections."""
        lines: list[str] = []
        columns = {**self.columns, **({} if self.tau_kind == "command" else {"tau_kind": self.tau_kind})}
        for table, key, value in (
            ("encoder", "counts_per_rev", self.counts_per_rev),
            ("encoder", "side", self.encoder_side),
            ("transmission", "friction_side", self.friction_side),
            ("transmission", "gear_ratio", self.gear_ratio),
            ("actuator", "torque_limit", self.torque_limit),
            ("geometry", "link_length", self.link_length),
            ("geometry", "link_mass", self.link_mass),
        ):
            if value is not None:
                opened = f"[{table}]" in lines
                lines += [*(() if opened else ("", f"[{table}]")), f"{key} = {listed(value)}"]
        if self.limits is not None:
            lines += ["", *self.limits.toml_lines()]
        if self.controller is not None:
            kind = [f"kind = {quoted(self.controller.kind)}", f"kd_on = {quoted(self.controller.kd_on)}"]
            gains = [f"{name} = {listed(values)}" for name, values in self.controller.vectors]
            lines += ["", "[controller]", *kind, *gains]
        if columns:
            lines += ["", "[columns]", *(f"{k} = {quoted(v)}" for k, v in columns.items())]
        if self.corrections:
            lines += ["", "[corrections]", *self.corrections.toml_lines()]
        if self.sealed is not None:
            lines += ["", "[sealed]", f"sha256 = {quoted(self.sealed)}"]
        return lines


def checked_arm(arm: Any) -> Arm:
    """Return `arm` if it is an `Arm`.

    Raises
    ------
    OptionError
        If it is anything else; the message names how an `Arm` is made.
    """
    if isinstance(arm, Arm):
        return arm
    raise not_an_arm(arm)


def arm_of(arm: Any) -> Arm:
    """Return an `Arm`, or the arm of an arm file by its path.

    Raises
    ------
    ArmFileError
        If the arm file cannot be read.
    OptionError
        If `arm` is neither; the message names what is accepted.
    """
    if isinstance(arm, str | os.PathLike):
        return Arm.read(Path(arm))
    return checked_arm(arm)


def quoted(text: str) -> str:
    """Return a text as a basic string of TOML: escaped like JSON, and DEL escaped too."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def listed(values: Iterable[Any]) -> str:
    """Return words or numbers as an array of TOML, numbers at full precision."""
    return "[" + ", ".join(quoted(v) if isinstance(v, str) else repr(float(v)) for v in values) + "]"


def _at_motor(sides: tuple[Side, ...] | None) -> list[bool | None] | None:
    """Return per joint whether `sides` names the motor side of the transmission; None where the side is unknown."""
    return None if sides is None else [None if side == "unknown" else side == "motor" for side in sides]


def kinds() -> dict[str, dict[str, Any]]:
    """Return the properties of each kind of arm by name: joints, number of inertial parameters, parameter names and units."""
    return {entry["kind"]: entry for entry in _native.arm_kinds()}


def only_planar(arm: Arm, what: str) -> None:
    """Raise if the arm is a serial arm, for a function that supports only axis, pendulum and two-link arms.

    Raises
    ------
    OptionError
        If the arm is a serial arm, or none; the message names the function `what`.
    """
    if checked_arm(arm).chain is not None:
        raise OptionError(f"{what} does not take serial arms", remedy=f"give an arm of the kind {', '.join(kinds())}")
