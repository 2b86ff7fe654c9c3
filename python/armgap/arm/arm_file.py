"""Reading and checking of arm files; every error message names the file and the key."""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.arm.arm import MotionLimits, kinds
from armgap.arm.controller import Controller, DerivativeOn
from armgap.arm.free_space import FreeSpace
from armgap.errors import ArmFileError, OptionError
from armgap.files.reading import printable, read_bounded
from armgap.literals import SERIAL, Side

if TYPE_CHECKING:
    from armgap.arm.corrections import Corrections

__all__ = ["LONGEST_PERIOD_S", "SHORTEST_PERIOD_S", "STRONGEST_GRAVITY", "ArmFile", "suggest"]

_TABLES: dict[str, tuple[str, ...]] = {
    "inertial": ("theta", "sigma"),
    "links": ("mass", "length", "com", "inertia", "sigma"),
    "friction": ("viscous", "coulomb", "sigma_viscous", "sigma_coulomb"),
    "encoder": ("counts_per_rev", "side"),
    "transmission": ("friction_side", "gear_ratio"),
    "actuator": ("torque_limit",),
    "geometry": ("link_length", "link_mass"),
    "limits": ("position_min", "position_max", "speed", "acceleration", "link_radius", "boxes"),
    "controller": ("kind", "kp", "kd", "kd_on"),
    "columns": (),
    "corrections": (),
    "sealed": ("sha256",),
}
_SCALARS = ("name", "kind", "gravity", "sample_period")
_MAX_ARM_FILE_BYTES = 2**20
"""Largest accepted size of an arm file, bytes: a thousand times what an arm file needs."""
_FORMATS = "docs/formats.md, Arm file"
_CLOSE_KIND = 0.75
"""String similarity above which a known kind of arm is suggested for a misspelt kind (`six-axis` and `axis`, different machines, have 0.67)."""
_MARKUP = {"robot": "a URDF", "sdf": "an SDF model", "mujoco": "an MJCF model"}
_KINDS = [*kinds(), SERIAL]
_REMEDY_MARKUP = (
    f"make an arm file of it with armgap model, or write one of the kind {', '.join(_KINDS)}; see {_FORMATS}"
)
#: Standard deviations of parameters whose arm file states none, as a part of the parameter's value: inertial parameters from a drawing
#: are right to 10 %, friction coefficients to half.
_INERTIAL_SIGMA = 0.1
_FRICTION_SIGMA = 0.5
_LISTED_NAMES = 40
"""Largest number of names that an error message lists: enough for all keys of a table, too few for all links of a humanoid."""
STRONGEST_GRAVITY = 30.0  # largest accepted acceleration of gravity, m/s^2
# Range of plausible sample periods [s]; a period outside the range is in another unit.
SHORTEST_PERIOD_S = 1e-5
LONGEST_PERIOD_S = 0.5


class ArmFile:
    """Content of one arm file, with the checks of its keys and values."""

    tables: Mapping[str, tuple[str, ...]] = _TABLES
    scalars: tuple[str, ...] = _SCALARS

    def __init__(self, path: Path, data: dict[str, Any]) -> None:
        self.path = path
        self.data = data

    @classmethod
    def load(cls, path: Path) -> ArmFile:
        """Read an arm file as TOML."""
        try:
            text = read_bounded(path, _MAX_ARM_FILE_BYTES).decode("utf-8-sig")
        except OSError as error:
            raise ArmFileError(
                f"cannot be read ({error.strerror or error})", remedy="give the path of an arm file", file=path
            ) from None
        except UnicodeDecodeError:
            raise ArmFileError("is not text", remedy="an arm file is TOML in UTF-8", file=path) from None
        if text.lstrip().startswith("<"):
            raise ArmFileError(f"is {_markup(text)} and no arm file", remedy=_REMEDY_MARKUP, file=path)
        try:
            data = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise ArmFileError(f"is not valid TOML: {error}", remedy="correct that line", file=path) from None
        return cls(path, data)

    def error(self, key: str, problem: str, remedy: str) -> ArmFileError:
        """Return the error about a key of the arm file, with the problem and its remedy."""
        return ArmFileError(problem, remedy=remedy, file=self.path, column=key)

    def fields(self) -> dict[str, Any]:
        """Return the checked fields of an `Arm` by name."""
        if self.data.get("kind") == SERIAL:
            from armgap.arm.serial.arm_file import SerialArmFile

            return SerialArmFile(self.path, self.data).fields()
        self._check_keys()
        kind = self._kind()
        info = kinds()[kind]
        n, b = int(info["n_joints"]), int(info["n_inertial"])
        gravity = self._number("gravity", default=9.81, lowest=0.0, highest=STRONGEST_GRAVITY)
        period = self._sample_period()
        inertial, inertial_sigma = self._inertial(kind, gravity, n, b)
        friction = self._table("friction")
        viscous = self._vector(friction, "friction.viscous", n, minimum=0.0)
        coulomb = self._vector(friction, "friction.coulomb", n, minimum=0.0)
        sigma_viscous = self._sigma(friction, "friction.sigma_viscous", viscous, _FRICTION_SIGMA)
        sigma_coulomb = self._sigma(friction, "friction.sigma_coulomb", coulomb, _FRICTION_SIGMA)
        columns = self._columns(n)
        self._check_inertia(kind, inertial)
        return dict(
            name=self._text("name", default=printable(self.path.stem)),
            kind=kind,
            gravity=gravity,
            sample_period=period,
            theta=np.concatenate([inertial, viscous, coulomb]),
            sigma=np.concatenate([inertial_sigma, sigma_viscous, sigma_coulomb]),
            counts_per_rev=self._optional("encoder.counts_per_rev", n),
            torque_limit=self._optional("actuator.torque_limit", n),
            link_length=self._lengths(n),
            link_mass=self._masses(n),
            encoder_side=self._sides("encoder.side", n),
            friction_side=self._sides("transmission.friction_side", n),
            gear_ratio=self._optional("transmission.gear_ratio", n),
            columns=columns,
            corrections=self._corrections(),
            sealed=self._sealed(),
            path=self.path,
            limits=self._limits(n),
            controller=self._controller(n),
        )

    def _check_keys(self) -> None:
        known = [*self.scalars, *self.tables]
        for key, value in self.data.items():
            if key not in known:
                raise self.error(key, "is not a key of an arm file", suggest(key, known))
            if key in self.tables and not isinstance(value, dict):
                raise self.error(key, "must be a table", f"write [{key}]")
            for inner in value if self.tables.get(key) else ():
                if inner not in self.tables[key]:
                    name = f"{key}.{inner}"
                    raise self.error(name, f"is not a key of [{key}]", suggest(inner, self.tables[key]))

    def _kind(self) -> str:
        kind = self._text("kind")
        if kind not in kinds():
            remedy = suggest(kind, _KINDS, _CLOSE_KIND)
            raise self.error("kind", f"`{kind}` is not a kind of arm", f"{remedy}; see {_FORMATS}")
        return kind

    def _text(self, key: str, default: str | None = None) -> str:
        value = self.data.get(key, default)
        if not isinstance(value, str):
            problem = "is missing" if value is None else "must be a string"
            raise self.error(key, problem, f'write {key} = "..."')
        return value

    def _number(self, key: str, *, lowest: float, highest: float, default: float | None = None) -> float:
        value = self.data.get(key, default)
        if value is None:
            raise self.error(key, "is missing", f"write {key} = a number in SI units")
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise self.error(key, f"must be a finite number, not {value!r}", "give it in SI units")
        if not lowest <= value <= highest:
            raise self.error(key, f"is {value}, outside {lowest:g} to {highest:g}", "give it in SI units")
        return float(value)

    def _sample_period(self) -> float:
        return self._number("sample_period", lowest=SHORTEST_PERIOD_S, highest=LONGEST_PERIOD_S)

    def _table(self, name: str) -> dict[str, Any]:
        if name not in self.data:
            raise self.error(name, "is missing", f"add a [{name}] table")
        table: dict[str, Any] = self.data[name]
        return table

    def _vector(
        self, table: dict[str, Any], key: str, n: int, minimum: float | None = None, above: float | None = None
    ) -> NDArray[np.float64]:
        value = table.get(key.rpartition(".")[2])
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

    def _sigma(self, table: dict[str, Any], key: str, values: NDArray[np.float64], share: float) -> NDArray[np.float64]:
        if key.split(".")[1] in table:
            return self._vector(table, key, len(values), above=0.0)
        # A value of zero gets the standard deviation of a tenth of the largest value.
        typical = float(np.max(np.abs(values))) if np.any(values) else 1.0
        return share * np.where(values != 0, np.abs(values), 0.1 * typical)

    def _inertial(self, kind: str, gravity: float, n: int, b: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if ("inertial" in self.data) == ("links" in self.data):
            problem = "stands beside [links]" if "inertial" in self.data else "is missing"
            raise self.error("inertial", problem, "give exactly one of [inertial] and [links]")
        if "inertial" in self.data:
            table = self._table("inertial")
            theta = self._vector(table, "inertial.theta", b)
            return theta, self._sigma(table, "inertial.sigma", theta, _INERTIAL_SIGMA)
        links = self._table("links")
        mass = self._vector(links, "links.mass", n, above=0.0)
        length = self._vector(links, "links.length", n, minimum=0.0)
        com = self._vector(links, "links.com", n)
        inertia = self._vector(links, "links.inertia", n, minimum=0.0)
        lists = [x.tolist() for x in (mass, length, com, inertia)]
        theta = _native.theta_from_links(kind, gravity, *lists)
        return theta, self._sigma(links, "links.sigma", theta, _INERTIAL_SIGMA)

    def _optional(self, key: str, n: int) -> NDArray[np.float64] | None:
        table = self.data.get(key.split(".")[0], {})
        return self._vector(table, key, n, above=0.0) if key.split(".")[1] in table else None

    def _sides(self, key: str, n: int) -> tuple[Side, ...] | None:
        table, name = key.split(".")
        value = self.data.get(table, {}).get(name)
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != n or any(side not in get_args(Side) for side in value):
            words = ", ".join(f'"{side}"' for side in get_args(Side))
            raise self.error(key, f"needs a list of {n} of {words}, found {value!r}", "one entry per joint")
        return tuple(value)

    def _lengths(self, n: int) -> NDArray[np.float64] | None:
        if "links" in self.data and "geometry" not in self.data:
            return self._vector(self.data["links"], "links.length", n, minimum=0.0)
        return self._optional("geometry.link_length", n)

    def _masses(self, n: int) -> NDArray[np.float64] | None:
        if "links" in self.data and "link_mass" not in self.data.get("geometry", {}):
            return self._vector(self.data["links"], "links.mass", n, above=0.0)
        return self._optional("geometry.link_mass", n)

    def _column_keys(self, n: int) -> list[str]:
        """Return the names of log columns that an arm file's table ``[columns]`` can map for an arm of n joints."""
        return ["t", *(f"{kind}{j}" for kind in ("q", "tau", "dq", "tau_meas", "q_link") for j in range(1, n + 1))]

    def _limits(self, n: int) -> MotionLimits | None:
        if "limits" not in self.data:
            return None
        table = self._table("limits")
        low, high = (self._vector(table, f"limits.{key}", n) for key in ("position_min", "position_max"))
        for i, (least, most) in enumerate(zip(low, high, strict=True)):
            if not least < most:
                problem = f"entry {i + 1} is {most:g}, not above position_min, {least:g}"
                raise self.error("limits.position_max", problem, "correct one of them")
        speed, acceleration = (self._vector(table, f"limits.{key}", n, above=0.0) for key in ("speed", "acceleration"))
        return MotionLimits(low, high, speed, acceleration, self._space(table, n))

    def _space(self, table: dict[str, Any], n: int) -> FreeSpace | None:
        if "link_radius" not in table:
            if "boxes" in table:
                raise self.error("limits.link_radius", "is missing", "give the radius of every link [m] beside `boxes`")
            return None
        if self.data.get("kind") == "axis":
            raise self.error(
                "limits.link_radius", "is for links that turn", "leave it out; position_min and _max do the same"
            )
        radius = self._vector(table, "limits.link_radius", n, above=0.0)
        lengths = self._lengths(n)
        if lengths is None or not np.all(lengths > 0):
            raise self.error(
                "geometry.link_length", "is missing", f"give the lengths of all {n} links [m] for `link_radius`"
            )
        boxes = table.get("boxes", [])
        if not isinstance(boxes, list):
            raise self.error("limits.boxes", f"is {boxes!r}", "give a list of [x_min, y_min, x_max, y_max]")
        rows = [self._vector({"boxes": box}, "limits.boxes", 4) for box in boxes]
        for i, (x, y, right, top) in enumerate(rows):
            if not (x < right and y < top):
                raise self.error("limits.boxes", f"box {i + 1} has no inside", "give [x_min, y_min, x_max, y_max]")
        return FreeSpace(lengths, radius, np.array(rows, dtype=np.float64).reshape(-1, 4))

    def _controller(self, n: int) -> Controller | None:
        if "controller" not in self.data:
            return None
        table = self._table("controller")
        if (kind := table.get("kind")) != "pd":
            problem = "is missing" if kind is None else f"{kind!r} is not a kind of controller"
            raise self.error("controller.kind", problem, 'write kind = "pd"')
        damping = table.get("kd_on", "measurement")
        if damping not in get_args(DerivativeOn):
            words = " or ".join(f'"{word}"' for word in get_args(DerivativeOn))
            raise self.error("controller.kd_on", f"is {damping!r}", f"write {words}")
        kp = self._vector(table, "controller.kp", n, above=0.0)
        return Controller(kp, self._vector(table, "controller.kd", n, minimum=0.0), damping)

    def _columns(self, n: int) -> dict[str, str]:
        known = self._column_keys(n)
        mapping = self.data.get("columns", {})
        for key, value in mapping.items():
            if key not in known:
                raise self.error(f"columns.{key}", "is not a column of a log", suggest(key, known))
            if not isinstance(value, str):
                raise self.error(f"columns.{key}", "must be a string", "give the log's own name of the column")
            if list(mapping.values()).count(value) > 1:
                raise self.error(f"columns.{key}", f"`{value}` is mapped twice", "map each column once")
        return dict(mapping)

    def _corrections(self) -> Corrections:
        """Return the corrections of log columns that the arm file states."""
        from armgap.arm.corrections import CORRECTIONS, Corrections

        given = self.data.get("corrections", {})
        for key in given:
            if key not in CORRECTIONS:
                raise self.error(f"corrections.{key}", "is not a correction", suggest(key, list(CORRECTIONS)))
        try:
            return Corrections.parse(**given)
        except OptionError as error:
            raise self.error("corrections", error.problem, error.remedy) from None

    def _sealed(self) -> str | None:
        value = self.data.get("sealed", {}).get("sha256")
        if value is not None and not (isinstance(value, str) and re.fullmatch(r"[0-9a-f]{64}", value)):
            raise self.error("sealed.sha256", "is not a SHA-256 sum", "give 64 hexadecimal digits")
        return value

    def _check_inertia(self, kind: str, theta: NDArray[np.float64]) -> None:
        key = "inertial.theta" if "inertial" in self.data else "links"
        if theta[0] <= 0:
            raise self.error(key, f"theta1 is {theta[0]:g}; an inertia must be positive", "correct it")
        if kind == "two-link":
            # The determinant of M(q) is a parabola in cos q2 that opens downwards: positive at both ends is enough.
            for c in (-1.0, 1.0):
                m11, m12, m22 = theta[0] + 2 * theta[1] * c, theta[2] + theta[1] * c, theta[2]
                if m22 <= 0 or m11 * m22 - m12 * m12 <= 0:
                    raise self.error(
                        key,
                        "gives an inertia matrix that is not positive definite",
                        "check the order of theta and its units (kg m^2, N m)",
                    )


def _markup(text: str) -> str:
    """Return the format of a text in angle brackets: URDF, MJCF or other XML."""
    root = re.search(r"<([A-Za-z][\w:.-]*)", re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL))
    return _MARKUP.get(root[1] if root else "", "XML")


def suggest(word: str, known: Sequence[str], cutoff: float = 0.6) -> str:
    """Return a hint for a misspelt word: the closest known word, then the first of the known words."""
    close = difflib.get_close_matches(word, known, n=1, cutoff=cutoff)
    more = f", and {len(known) - _LISTED_NAMES} more" if len(known) > _LISTED_NAMES else ""
    listed = ", ".join(known[:_LISTED_NAMES]) + more
    return f"did you mean `{close[0]}`? (known: {listed})" if close else f"known: {listed}"
