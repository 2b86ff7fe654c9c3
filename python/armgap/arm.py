"""Arm files: the nominal model of an arm and how far its values are trusted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.literals import DampingOn, Side

if TYPE_CHECKING:
    from armgap.check.corrections import Corrections

__all__ = ["Arm", "Controller", "MotionLimits", "kinds"]


@dataclass(frozen=True)
class MotionLimits:
    """What an arm's joints may do; the torque's limit is the arm's `torque_limit`.

    Attributes
    ----------
    position_min, position_max : ndarray, shape (n_joints,)
        Range of positions [rad or m].
    speed, acceleration : ndarray, shape (n_joints,)
        Largest speed [rad/s or m/s] and acceleration [rad/s^2 or m/s^2].
    """

    position_min: NDArray[np.float64]
    position_max: NDArray[np.float64]
    speed: NDArray[np.float64]
    acceleration: NDArray[np.float64]


@dataclass(frozen=True)
class Controller:
    """Position controller of an arm: ``tau = kp (q_ref - q) + kd (dq_ref - dq)``, or ``- kd dq``.

    Attributes
    ----------
    kp, kd : ndarray, shape (n_joints,)
        Gains [N m/rad and N m s/rad, or N/m and N s/m].
    kd_on : {"measurement", "error"}
        Whether the damping acts on the measured velocity or on its error.
    """

    kp: NDArray[np.float64]
    kd: NDArray[np.float64]
    kd_on: DampingOn = "measurement"


@dataclass(frozen=True)
class Arm:
    """The nominal model of an arm.

    Attributes
    ----------
    name : str
        Name for people.
    kind : str
        ``"axis"``, ``"pendulum"`` or ``"two-link"``.
    gravity : float
        Acceleration of gravity [m/s^2].
    sample_period : float
        Nominal sample period [s].
    theta, sigma : ndarray, shape (n_parameters,)
        Inertial base parameters, then viscous, then Coulomb coefficients per joint [SI], and the 1-sigma trust in each.
    counts_per_rev : ndarray, shape (n_joints,), optional
        Encoder counts per revolution (per metre on a linear joint).
    torque_limit : ndarray, shape (n_joints,), optional
        Torque limit [N m].
    link_length : ndarray, shape (n_joints,), optional
        Link lengths [m].
    link_mass : ndarray, shape (n_joints,), optional
        Link masses [kg]; motion does not tell them, an export to a simulator wants them.
    encoder_side, friction_side : tuple of {"motor", "link", "unknown"}, optional
        Per joint, the side of the transmission that the encoder measures and that friction acts on. Where it is unknown, an elastic or
        slack transmission is tried with both.
    gear_ratio : ndarray, shape (n_joints,), optional
        Turns of the motor per turn of the joint.
    columns : dict of str to str
        Names that the arm's logs use for ``t``, ``q1``, ``tau1`` and so on.
    sealed : str, optional
        SHA-256 of a sealed key that belongs to the arm's logs.
    path : Path, optional
        File it was read from.
    corrections : Corrections, optional
        How columns of the arm's logs are to be read otherwise than they stand.
    limits : MotionLimits, optional
        What a planned motion keeps to.
    controller : Controller, optional
        Position controller that tracks a planned motion.
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
    controller: Controller | None = None

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
            If the file is missing, not TOML, or describes no possible arm; it names the key.
        """
        from armgap.arm_file import ArmFile

        arm = cls(**ArmFile.load(Path(path)).fields())
        return arm if arm.corrections is None else arm.corrections.on_arm(arm)

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return int(self._kind["n_joints"])

    @property
    def n_inertial(self) -> int:
        """Number of inertial base parameters."""
        return int(self._kind["n_inertial"])

    @property
    def rotary(self) -> bool:
        """Whether positions are angles."""
        return bool(self._kind["rotary"])

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the entries of `theta`."""
        return tuple(self._kind["parameter_names"])

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units of the entries of `theta`."""
        return tuple(self._kind["parameter_units"])

    @property
    def gravity_parameters(self) -> NDArray[np.intp]:
        """Indices of the entries of `theta` that are weights: torques or forces of gravity [N m or N]."""
        weight = "N m" if self.rotary else "N"
        return np.array([i for i in range(self.n_inertial) if self.parameter_units[i] == weight], dtype=np.intp)

    @property
    def expects_weight(self) -> bool:
        """Whether the weights in `theta` are those of an arm that hangs down at zero: none negative, one positive."""
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
        return (2 * np.pi if self.rotary else 1.0) / self.counts_per_rev

    def _repr_html_(self) -> str:
        """Return kind, conventions and parameters as HTML for a notebook."""
        from armgap.report.shown import arm_facts

        return arm_facts(self).html()

    def _repr_markdown_(self) -> str:
        """Return kind, conventions and parameters as Markdown."""
        from armgap.report.shown import arm_facts

        return arm_facts(self).markdown()

    def to_native(self) -> dict[str, Any]:
        """Return the arm as the compiled core takes it."""

        def as_list(x: NDArray[np.float64] | None) -> list[float] | None:
            return None if x is None else [float(v) for v in x]

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
        }

    def to_toml(self) -> str:
        """Return the arm as an arm file."""
        n, b = self.n_joints, self.n_inertial
        lines = [
            f"name = {_quoted(self.name)}",
            f"kind = {_quoted(self.kind)}",
            f"gravity = {self.gravity!r}",
            f"sample_period = {self.sample_period!r}",
            "",
            "[inertial]",
            f"theta = {_listed(self.theta[:b])}",
            f"sigma = {_listed(self.sigma[:b])}",
            "",
            "[friction]",
            f"viscous = {_listed(self.theta[b : b + n])}",
            f"coulomb = {_listed(self.theta[b + n :])}",
            f"sigma_viscous = {_listed(self.sigma[b : b + n])}",
            f"sigma_coulomb = {_listed(self.sigma[b + n :])}",
        ]
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
                lines += [*(() if opened else ("", f"[{table}]")), f"{key} = {_listed(value)}"]
        if self.limits is not None:
            lines += [
                "",
                "[limits]",
                *(f"{f.name} = {_listed(getattr(self.limits, f.name))}" for f in fields(self.limits)),
            ]
        if self.controller is not None:
            gains = (f"{key} = {_listed(getattr(self.controller, key))}" for key in ("kp", "kd"))
            lines += ["", "[controller]", 'kind = "pd"', *gains, f"kd_on = {_quoted(self.controller.kd_on)}"]
        if self.columns:
            lines += ["", "[columns]", *(f"{k} = {_quoted(v)}" for k, v in self.columns.items())]
        if self.corrections:
            lines += ["", "[corrections]", *self.corrections.toml_lines()]
        if self.sealed is not None:
            lines += ["", "[sealed]", f"sha256 = {_quoted(self.sealed)}"]
        return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'


def _listed(values: Iterable[Any]) -> str:
    return "[" + ", ".join(_quoted(v) if isinstance(v, str) else repr(float(v)) for v in values) + "]"


def _at_motor(sides: tuple[Side, ...] | None) -> list[bool | None] | None:
    """Return per joint whether something sits at the motor, None where that is unknown."""
    return None if sides is None else [None if side == "unknown" else side == "motor" for side in sides]


def kinds() -> dict[str, dict[str, Any]]:
    """Return the kinds of arm by name: joints, number of inertial parameters, parameter names and units."""
    return {entry["kind"]: entry for entry in _native.arm_kinds()}
