"""Arm files: the nominal model of an arm and how far its values are trusted."""

from __future__ import annotations

import difflib
import math
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.errors import ArmFileError

__all__ = ["Arm"]

_TABLES: dict[str, tuple[str, ...]] = {
    "inertial": ("theta", "sigma"),
    "links": ("mass", "length", "com", "inertia", "sigma"),
    "friction": ("viscous", "coulomb", "sigma_viscous", "sigma_coulomb"),
    "encoder": ("counts_per_rev",),
    "actuator": ("torque_limit",),
    "geometry": ("link_length",),
    "columns": (),
    "sealed": ("sha256",),
}
_SCALARS = ("name", "kind", "gravity", "sample_period")
_INERTIAL_SIGMA = 0.1
_FRICTION_SIGMA = 0.5


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
    columns : dict of str to str
        Names that the arm's logs use for ``t``, ``q1``, ``tau1`` and so on.
    sealed : str, optional
        SHA-256 of a sealed key that belongs to the arm's logs.
    path : Path, optional
        File it was read from.
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
        path = Path(path)
        try:
            text = path.read_text(encoding="utf-8")
        except OSError as error:
            raise ArmFileError(
                f"cannot be read ({error.strerror or error})", remedy="give the path of an arm file", file=path
            ) from None
        except UnicodeDecodeError:
            raise ArmFileError("is not text", remedy="an arm file is TOML in UTF-8", file=path) from None
        try:
            data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise ArmFileError(f"is not valid TOML: {error}", remedy="correct that line", file=path) from None
        return _Reader(path, data).arm()

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
    def _kind(self) -> dict[str, Any]:
        return _kinds()[self.kind]

    @property
    def encoder_step(self) -> NDArray[np.float64] | None:
        """Position step of one encoder count [rad or m], shape (n_joints,)."""
        if self.counts_per_rev is None:
            return None
        return (2 * np.pi if self.rotary else 1.0) / self.counts_per_rev

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
            ("actuator", "torque_limit", self.torque_limit),
            ("geometry", "link_length", self.link_length),
        ):
            if value is not None:
                lines += ["", f"[{table}]", f"{key} = {_listed(value)}"]
        if self.columns:
            lines += ["", "[columns]", *(f"{k} = {_quoted(v)}" for k, v in self.columns.items())]
        if self.sealed is not None:
            lines += ["", "[sealed]", f"sha256 = {_quoted(self.sealed)}"]
        return "\n".join(lines) + "\n"


def _kinds() -> dict[str, dict[str, Any]]:
    return {entry["kind"]: entry for entry in _native.arm_kinds()}


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'


def _listed(values: NDArray[np.float64]) -> str:
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"


class _Reader:
    """One arm file being checked."""

    def __init__(self, path: Path, data: dict[str, Any]) -> None:
        self.path = path
        self.data = data

    def error(self, key: str, problem: str, remedy: str) -> ArmFileError:
        return ArmFileError(problem, remedy=remedy, file=self.path, column=key)

    def arm(self) -> Arm:
        self.check_keys()
        kind = self.kind()
        info = _kinds()[kind]
        n, b = int(info["n_joints"]), int(info["n_inertial"])
        gravity = self.number("gravity", default=9.81, positive=False)
        period = self.number("sample_period", positive=True)
        inertial, inertial_sigma = self.inertial(kind, gravity, n, b)
        friction = self.table("friction")
        viscous = self.vector(friction, "friction.viscous", n, minimum=0.0)
        coulomb = self.vector(friction, "friction.coulomb", n, minimum=0.0)
        sigma_viscous = self.sigma(friction, "friction.sigma_viscous", viscous, _FRICTION_SIGMA)
        sigma_coulomb = self.sigma(friction, "friction.sigma_coulomb", coulomb, _FRICTION_SIGMA)
        columns = self.columns(n)
        arm = Arm(
            name=self.text("name", default=self.path.stem),
            kind=kind,
            gravity=gravity,
            sample_period=period,
            theta=np.concatenate([inertial, viscous, coulomb]),
            sigma=np.concatenate([inertial_sigma, sigma_viscous, sigma_coulomb]),
            counts_per_rev=self.optional("encoder.counts_per_rev", n),
            torque_limit=self.optional("actuator.torque_limit", n),
            link_length=self.lengths(n),
            columns=columns,
            sealed=self.data.get("sealed", {}).get("sha256"),
            path=self.path,
        )
        self.check_inertia(arm)
        return arm

    def check_keys(self) -> None:
        known = [*_SCALARS, *_TABLES]
        for key, value in self.data.items():
            if key not in known:
                raise self.error(key, "is not a key of an arm file", _suggest(key, known))
            if key in _TABLES and not isinstance(value, dict):
                raise self.error(key, "must be a table", f"write [{key}]")
            if key in _TABLES and _TABLES[key]:
                for inner in value:
                    if inner not in _TABLES[key]:
                        name = f"{key}.{inner}"
                        raise self.error(name, f"is not a key of [{key}]", _suggest(inner, _TABLES[key]))

    def kind(self) -> str:
        kind = self.text("kind")
        if kind not in _kinds():
            raise self.error("kind", f"`{kind}` is not a kind of arm", _suggest(kind, list(_kinds())))
        return kind

    def text(self, key: str, default: str | None = None) -> str:
        value = self.data.get(key, default)
        if not isinstance(value, str):
            problem = "is missing" if value is None else "must be a string"
            raise self.error(key, problem, f'write {key} = "..."')
        return value

    def number(self, key: str, *, positive: bool, default: float | None = None) -> float:
        value = self.data.get(key, default)
        if value is None:
            raise self.error(key, "is missing", f"write {key} = a number in SI units")
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise self.error(key, f"must be a finite number, not {value!r}", "give it in SI units")
        if positive and value <= 0:
            raise self.error(key, f"must be positive, not {value}", "give it in SI units")
        return float(value)

    def table(self, name: str) -> dict[str, Any]:
        if name not in self.data:
            raise self.error(name, "is missing", f"add a [{name}] table")
        table: dict[str, Any] = self.data[name]
        return table

    def vector(
        self, table: dict[str, Any], key: str, n: int, minimum: float | None = None, above: float | None = None
    ) -> NDArray[np.float64]:
        value = table.get(key.split(".")[1])
        if value is None:
            raise self.error(key, "is missing", f"give a list of {n} numbers")
        if not isinstance(value, list) or len(value) != n:
            found = f"{len(value)} values" if isinstance(value, list) else repr(value)
            raise self.error(key, f"needs a list of {n} numbers, found {found}", "one entry per joint or parameter")
        for i, x in enumerate(value):
            if isinstance(x, bool) or not isinstance(x, int | float) or not math.isfinite(x):
                raise self.error(key, f"entry {i + 1} is {x!r}, not a finite number", "correct it")
            if minimum is not None and x < minimum:
                raise self.error(key, f"entry {i + 1} is {x}, less than {minimum:g}", "correct its sign")
            if above is not None and x <= above:
                raise self.error(key, f"entry {i + 1} is {x}, it must be above {above:g}", "correct it")
        return np.array(value, dtype=np.float64)

    def sigma(
        self, table: dict[str, Any], key: str, values: NDArray[np.float64], share: float
    ) -> NDArray[np.float64]:
        if key.split(".")[1] in table:
            return self.vector(table, key, len(values), above=0.0)
        # A value of zero is trusted as far as the others are.
        typical = float(np.max(np.abs(values))) if np.any(values) else 1.0
        return share * np.where(values != 0, np.abs(values), 0.1 * typical)

    def inertial(
        self, kind: str, gravity: float, n: int, b: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if ("inertial" in self.data) == ("links" in self.data):
            problem = "stands beside [links]" if "inertial" in self.data else "is missing"
            raise self.error("inertial", problem, "give exactly one of [inertial] and [links]")
        if "inertial" in self.data:
            table = self.table("inertial")
            theta = self.vector(table, "inertial.theta", b)
            return theta, self.sigma(table, "inertial.sigma", theta, _INERTIAL_SIGMA)
        links = self.table("links")
        mass = self.vector(links, "links.mass", n, above=0.0)
        length = self.vector(links, "links.length", n, minimum=0.0)
        com = self.vector(links, "links.com", n)
        inertia = self.vector(links, "links.inertia", n, minimum=0.0)
        lists = [x.tolist() for x in (mass, length, com, inertia)]
        theta = _native.theta_from_links(kind, gravity, *lists)
        return theta, self.sigma(links, "links.sigma", theta, _INERTIAL_SIGMA)

    def optional(self, key: str, n: int) -> NDArray[np.float64] | None:
        table = self.data.get(key.split(".")[0], {})
        return self.vector(table, key, n, above=0.0) if key.split(".")[1] in table else None

    def lengths(self, n: int) -> NDArray[np.float64] | None:
        if "links" in self.data and "geometry" not in self.data:
            return self.vector(self.data["links"], "links.length", n, minimum=0.0)
        return self.optional("geometry.link_length", n)

    def columns(self, n: int) -> dict[str, str]:
        known = ["t", *(f"{kind}{j}" for kind in ("q", "tau", "dq") for j in range(1, n + 1))]
        mapping = self.data.get("columns", {})
        for key, value in mapping.items():
            if key not in known:
                raise self.error(f"columns.{key}", "is not a column of a log", _suggest(key, known))
            if not isinstance(value, str):
                raise self.error(f"columns.{key}", "must be a string", "give the log's own name of the column")
        return dict(mapping)

    def check_inertia(self, arm: Arm) -> None:
        theta = arm.theta[: arm.n_inertial]
        table = "inertial.theta" if "inertial" in self.data else "links"
        if theta[0] <= 0:
            raise self.error(table, f"theta1 is {theta[0]:g}; an inertia must be positive", "correct it")
        if arm.kind == "two-link":
            # M(q) is positive definite for every q2 if it is at cos q2 = -1, 0 and 1.
            for c in (-1.0, 0.0, 1.0):
                m11, m12, m22 = theta[0] + 2 * theta[1] * c, theta[2] + theta[1] * c, theta[2]
                if m22 <= 0 or m11 * m22 - m12 * m12 <= 0:
                    raise self.error(
                        table,
                        "gives an inertia matrix that is not positive definite",
                        "check the order of theta and its units (kg m^2, N m)",
                    )


def _suggest(word: str, known: list[str] | tuple[str, ...]) -> str:
    close = difflib.get_close_matches(word, known, n=1)
    listed = ", ".join(known)
    return f"did you mean `{close[0]}`? (known: {listed})" if close else f"known: {listed}"
