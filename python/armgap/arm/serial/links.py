"""The ``[[link]]`` tables of an arm file: joint, placement, axis, inertia and limits of each link of a chain."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm_file import suggest
from armgap.arm.description.resolved import ResolvedModel
from armgap.arm.rigid_body import about_origin, inconsistency, rpy_matrix, symmetric, unit_axis
from armgap.arm.serial.chain import JointKind, SerialChain

if TYPE_CHECKING:
    from armgap.arm.arm_file import ArmFile

__all__ = ["INERTIA_KEYS", "LinkTables"]

Array = NDArray[np.float64]

INERTIA_KEYS = ("ixx", "ixy", "iyy", "ixz", "iyz", "izz")
_KEYS = (
    "joint", "link", "kind", "axis", "placement", "mass", "com", "inertia", "theta", "sigma", "position_min",
    "position_max", "speed", "acceleration", "effort",
)  # fmt: skip
_PLACEMENT = ("xyz", "rpy", "rotation")
_KINDS: dict[str, JointKind] = {**{kind: kind for kind in get_args(JointKind)}, "continuous": "revolute"}
#: Largest number of ``[[link]]`` tables in an arm file.
_MOST_JOINTS = 64
# Largest deviation of a rotation matrix in an arm file from an orthonormal matrix; a matrix within it, from few digits, is orthonormalised.
_ROTATION = 1e-3
_ORTHONORMAL_ROUNDING = 1e-12


class LinkTables:
    """The ``[[link]]`` tables of one arm file while they are checked."""

    def __init__(self, file: ArmFile, tables: Any) -> None:
        self.file = file
        self.tables = tables

    def model(self, gravity: Array) -> ResolvedModel:
        """Return the chain and inertia of all links in the tables, with gravity in the frame of the base."""
        if not isinstance(self.tables, list) or not self.tables or not all(isinstance(t, dict) for t in self.tables):
            raise self._error("link", "must be a list of tables", "write [[link]] before each link")
        if len(self.tables) > _MOST_JOINTS:
            raise self._error("link", f"there are {len(self.tables)} links", f"give at most {_MOST_JOINTS}")
        joints = [self._word(i, "joint") for i in range(len(self.tables))]
        links = [self._word(i, "link", default=joints[i]) for i in range(len(joints))]
        for key, names in (("joint", joints), ("link", links)):
            for i, name in enumerate(names):
                if name in names[:i]:
                    raise self._error(f"link {i + 1}.{key}", f"`{name}` is there twice", "give each its own name")
        for i, table in enumerate(self.tables):
            for key in table:
                if key not in _KEYS:
                    raise self._error(f"link {i + 1}.{key}", "is not a key of [[link]]", suggest(key, list(_KEYS)))
        n = len(joints)
        placements = [self._placement(i) for i in range(n)]
        limits = {key: np.array([self._limit(i, key) for i in range(n)]) for key in ("speed", "acceleration", "effort")}
        lower, upper = self._positions()
        chain = SerialChain(
            joint_names=tuple(joints),
            link_names=tuple(links),
            kinds=tuple(self._kind(i) for i in range(n)),
            rotation=np.array([rotation for rotation, _ in placements]),
            translation=np.array([translation for _, translation in placements]),
            axis=np.array([self._axis(i) for i in range(n)]),
            gravity=gravity,
            lower=lower,
            upper=upper,
            **limits,
        )
        inertial = np.array([self._inertial(i) for i in range(n)])
        notes = [
            f"link `{link}` is no body: {why}"
            for link, ten in zip(links, inertial, strict=True)
            if (why := inconsistency(ten))
        ]
        missing = np.full(n, math.nan)
        sigma = np.array([self._sigma(i) for i in range(n)])
        return ResolvedModel("", chain, inertial, missing, missing, missing, sigma=sigma, notes=tuple(notes))

    def _error(self, key: str, problem: str, remedy: str) -> Exception:
        return self.file.error(key, problem, remedy)

    def _word(self, i: int, key: str, default: str | None = None) -> str:
        value = self.tables[i].get(key, default)
        if not isinstance(value, str) or not value:
            problem = "is missing" if value is None else "must be a string"
            raise self._error(f"link {i + 1}.{key}", problem, f'write {key} = "..."')
        return value

    def _kind(self, i: int) -> JointKind:
        word = self._word(i, "kind", default="revolute")
        if word not in _KINDS:
            raise self._error(f"link {i + 1}.kind", f"`{word}` is no kind of joint", suggest(word, list(_KINDS)))
        return _KINDS[word]

    def _numbers(self, value: Any, key: str, shape: tuple[int, ...]) -> Array:
        """Return the value of a key as an array of finite numbers of a given shape."""
        size = " x ".join(map(str, shape))
        try:
            found = np.array(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            found = np.empty(0)
        if found.shape != shape or not _are_numbers(value):
            raise self._error(key, f"needs {size} numbers, found {value!r}", "correct it")
        if not np.isfinite(found).all():
            raise self._error(key, "holds a number that is not finite", "correct it")
        return found

    def _axis(self, i: int) -> Array:
        key = f"link {i + 1}.axis"
        axis = unit_axis(self._numbers(self.tables[i].get("axis", [0.0, 0.0, 1.0]), key, (3,)))
        if axis is None:
            raise self._error(key, "is zero", "give the direction that the joint turns about or slides along")
        return axis

    def _placement(self, i: int) -> tuple[Array, Array]:
        key = f"link {i + 1}.placement"
        table = self.tables[i].get("placement", {})
        if not isinstance(table, dict):
            raise self._error(key, "must be a table", "write placement = {xyz = [...], rpy = [...]}")
        for inner in table:
            if inner not in _PLACEMENT:
                raise self._error(f"{key}.{inner}", "is not a key of a placement", suggest(inner, list(_PLACEMENT)))
        if "rpy" in table and "rotation" in table:
            raise self._error(f"{key}.rpy", "stands beside `rotation`", "give one of them")
        translation = self._numbers(table.get("xyz", [0.0, 0.0, 0.0]), f"{key}.xyz", (3,))
        if "rotation" not in table:
            return rpy_matrix(self._numbers(table.get("rpy", [0.0, 0.0, 0.0]), f"{key}.rpy", (3,))), translation
        rotation = self._numbers(table["rotation"], f"{key}.rotation", (3, 3))
        off = float(np.max(np.abs(rotation @ rotation.T - np.eye(3))))
        if off > _ROTATION or np.linalg.det(rotation) < 0:
            raise self._error(f"{key}.rotation", "is no rotation", "give three rows at right angles, or rpy")
        if off > _ORTHONORMAL_ROUNDING:
            u, _, vt = np.linalg.svd(rotation)
            rotation = u @ vt
        return rotation, translation

    def inertia(self, value: Any, key: str) -> Array:
        """Return the six entries of an inertia matrix given by name: ``{ixx = ..., iyy = ..., izz = ...}``, off-diagonals 0 where left out."""
        if not isinstance(value, dict):
            raise self._error(
                key, f"must be a table, not {value!r}", "write inertia = {ixx = ..., iyy = ..., izz = ...}"
            )
        for inner in value:
            if inner not in INERTIA_KEYS:
                raise self._error(f"{key}.{inner}", "is not an entry of an inertia", suggest(inner, list(INERTIA_KEYS)))
        for inner in ("ixx", "iyy", "izz"):
            if inner not in value:
                raise self._error(f"{key}.{inner}", "is missing", "give ixx, iyy and izz in kg m^2")
        return np.array([float(self._numbers(value.get(k, 0.0), f"{key}.{k}", ())) for k in INERTIA_KEYS])

    def _inertial(self, i: int) -> Array:
        """Return the ten inertial parameters of link i; zeros where the arm file gives none."""
        table, key = self.tables[i], f"link {i + 1}"
        if "theta" in table:
            for other in ("mass", "com", "inertia"):
                if other in table:
                    raise self._error(f"{key}.{other}", "stands beside `theta`", "give one of them")
            return self._numbers(table["theta"], f"{key}.theta", (10,))
        if "mass" not in table:
            for other in ("com", "inertia"):
                if other in table:
                    raise self._error(f"{key}.mass", f"is missing beside `{other}`", "give it in kg")
            return np.zeros(10)
        mass = float(self._numbers(table["mass"], f"{key}.mass", ()))
        if mass <= 0:
            raise self._error(f"{key}.mass", f"is {mass:g}", "give a positive mass in kg, or none where it is unknown")
        com = self._numbers(table.get("com", [0.0, 0.0, 0.0]), f"{key}.com", (3,))
        six = self.inertia(table["inertia"], f"{key}.inertia") if "inertia" in table else np.zeros(6)
        return about_origin(mass, com, symmetric(six))

    def _sigma(self, i: int) -> Array:
        if "sigma" not in self.tables[i]:
            return np.full(10, math.nan)
        sigma = self._numbers(self.tables[i]["sigma"], f"link {i + 1}.sigma", (10,))
        if not (sigma > 0).all():
            raise self._error(f"link {i + 1}.sigma", "holds a number that is not positive", "correct it")
        return sigma

    def _limit(self, i: int, key: str) -> float:
        if key not in self.tables[i]:
            return math.inf
        value = float(self._numbers(self.tables[i][key], f"link {i + 1}.{key}", ()))
        if value <= 0:
            raise self._error(f"link {i + 1}.{key}", f"is {value:g}", "give a positive number, or none")
        return value

    def _positions(self) -> tuple[Array, Array]:
        """Return the lower and upper limits of position [rad or m]; infinite where the arm file gives none."""
        ends = []
        for i, table in enumerate(self.tables):
            low, high = (
                float(self._numbers(table[key], f"link {i + 1}.{key}", ())) if key in table else unbounded
                for key, unbounded in (("position_min", -math.inf), ("position_max", math.inf))
            )
            if low > high:
                raise self._error(f"link {i + 1}.position_max", "is below position_min", "exchange them")
            ends.append((low, high))
        lower, upper = np.array(ends).T
        return lower, upper


def _are_numbers(value: Any) -> bool:
    if isinstance(value, list):
        return all(_are_numbers(x) for x in value)
    return isinstance(value, int | float) and not isinstance(value, bool)
