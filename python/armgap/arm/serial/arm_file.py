"""Arm files of serial arms: the keys that only serial arms have, with the chain from a URDF, an MJCF model or ``[[link]]`` tables."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm_file import STRONGEST_GRAVITY, ArmFile, suggest
from armgap.arm.controller import VECTORS, Controller, DerivativeOn
from armgap.arm.description.resolved import ResolvedModel
from armgap.arm.rigid_body import about_origin, inconsistency, symmetric
from armgap.arm.serial.links import LinkTables
from armgap.arm.serial.trust import FRICTION_SHARE, TRUSTS, Scales, Trust, link_sigma
from armgap.files.reading import printable
from armgap.literals import SERIAL

__all__ = ["DESCRIPTION_KEYS", "SerialArmFile"]

Array = NDArray[np.float64]

_SCALARS = ("name", "kind", "urdf", "mjcf", "base", "tip", "gravity", "sample_period", "trust")
_TABLES: dict[str, tuple[str, ...]] = {
    "friction": ("viscous", "coulomb", "sigma_viscous", "sigma_coulomb"),
    "drive": ("rotor_inertia", "sigma_rotor_inertia", "gear_ratio", "torque_limit"),
    "frozen": (),
    "columns": (),
    "controller": tuple(f.name for f in fields(Controller)),
    "limits": ("position_min", "position_max", "speed", "acceleration"),
    "payload": ("mass", "com", "inertia"),
    "encoder": ("counts_per_rev", "side"),
    "transmission": ("friction_side", "gear_ratio"),
    "actuator": ("torque_limit",),
    "corrections": (),
    "sealed": ("sha256",),
}
DESCRIPTION_KEYS = ("urdf", "mjcf")
"""Keys of an arm file that name a robot's description, relative to the arm file."""
_SOURCES = (*DESCRIPTION_KEYS, "link")
_PLANAR = {
    "inertial": "write [[link]] tables, or name a description with urdf or mjcf",
    "links": "write [[link]] tables, or name a description with urdf or mjcf",
    "geometry": "leave it out: lengths are in the chain",
}
_HEAVIEST_PAYLOAD = 1e4  # largest accepted mass of a payload, kg
_FURTHEST_COM = 10.0  # largest accepted coordinate of a payload's centre of mass, m
_TAU_KINDS = ("command", "measured")


class SerialArmFile(ArmFile):
    """Content of one arm file of a serial arm, with the checks of its keys and values.

    Parameters
    ----------
    path : Path
        Arm file.
    data : dict
        Content of the arm file.
    described : ResolvedModel, optional
        Model of the arm, for an arm file that names no description.
    """

    tables = _TABLES
    scalars = _SCALARS
    joints: tuple[str, ...] = ()
    """Names of the chain's joints; empty until the chain is read."""

    def __init__(self, path: Path, data: dict[str, Any], described: ResolvedModel | None = None) -> None:
        super().__init__(path, data)
        self.described = described

    def fields(self) -> dict[str, Any]:
        """Return the checked fields of an `Arm` by name."""
        with np.errstate(over="ignore", invalid="ignore"):
            return self._fields()

    def _fields(self) -> dict[str, Any]:
        self._check_source()
        self._check_keys()
        period = self._sample_period()
        trust = self._trust()
        model = self._model()
        self.joints, n = model.chain.joint_names, model.chain.n_joints
        chain = self._limited(model)
        gravity = float(np.linalg.norm(chain.gravity))
        inertial, notes = self._loaded(model.inertial)
        scale = Scales(chain, model.inertial)
        sigma = link_sigma(model.inertial[:, 0], scale.length, trust)
        if model.sigma is not None:
            sigma = np.where(np.isfinite(model.sigma), model.sigma, sigma)
        rotor = self._nominal("drive.rotor_inertia", model.rotor_inertia, scale.inertia, 1.0)
        viscous = self._nominal("friction.viscous", model.viscous, scale.viscous, FRICTION_SHARE)
        coulomb = self._nominal("friction.coulomb", model.coulomb, scale.coulomb, FRICTION_SHARE)
        gear_ratio = self._either("drive.gear_ratio", "transmission.gear_ratio", n)
        torque_limit = self._either("drive.torque_limit", "actuator.torque_limit", n)
        if not (np.isfinite(inertial).all() and np.isfinite(sigma).all() and np.isfinite(chain.translation).all()):
            key = next((source for source in _SOURCES if source in self.data), "urdf")
            raise self.error(key, "gives links too heavy or too long to compute with", "give kg and m")
        return dict(
            name=self._text("name", default=model.name or printable(self.path.stem)),
            kind=SERIAL,
            gravity=gravity,
            sample_period=period,
            theta=np.concatenate([inertial.ravel(), rotor[0], viscous[0], coulomb[0]]),
            sigma=np.concatenate([sigma.ravel(), rotor[1], viscous[1], coulomb[1]]),
            counts_per_rev=self._optional("encoder.counts_per_rev", n),
            torque_limit=model.torque_limit if torque_limit is None else torque_limit,
            encoder_side=self._sides("encoder.side", n),
            friction_side=self._sides("transmission.friction_side", n),
            gear_ratio=model.gear_ratio if gear_ratio is None else gear_ratio,
            columns=self._columns(n),
            tau_kind=self._tau_kind(),
            corrections=self._corrections(),
            sealed=self._sealed(),
            path=self.path,
            chain=chain,
            controller=self._controller(n) or model.controller,
            notes=(*model.notes, *notes),
        )

    def _check_source(self) -> None:
        for key, remedy in _PLANAR.items():
            if key in self.data:
                raise self.error(key, "is not a table of a serial arm", remedy)
        given = [key for key in _SOURCES if key in self.data]
        if self.described is None and len(given) != 1:
            problem = f"stands beside `{given[0]}`" if given else "is missing"
            raise self.error(
                given[1] if given else "urdf", problem, "give exactly one of urdf, mjcf and [[link]] tables"
            )

    def _check_keys(self) -> None:
        links = self.data.pop("link", None)
        try:
            super()._check_keys()
        finally:
            if links is not None:
                self.data["link"] = links

    def _trust(self) -> Trust:
        word = self._text("trust", default="cad")
        if word not in TRUSTS:
            raise self.error("trust", f"is `{word}`", suggest(word, list(TRUSTS)))
        return next(trust for trust in TRUSTS if trust == word)

    def _gravity(self) -> Array | None:
        """Return gravity in the frame of the base [m/s^2], shape (3,); None where the arm file leaves gravity to the description."""
        value = self.data.get("gravity")
        if value is None:
            return None
        if isinstance(value, list):
            vector = self._vector(self.data, "gravity", 3)
            size = float(np.linalg.norm(vector))
            if size > STRONGEST_GRAVITY:
                raise self.error("gravity", f"is {size:g} m/s^2 strong", "give it in m/s^2")
            return vector
        return np.array([0.0, 0.0, -self._number("gravity", lowest=0.0, highest=STRONGEST_GRAVITY)])

    def _model(self) -> ResolvedModel:
        if self.described is not None:
            return self.described
        gravity = self._gravity()
        if "link" in self.data:
            for key in ("base", "tip"):
                if key in self.data:
                    raise self.error(key, "stands beside [[link]] tables", "leave it out: they are the chain")
            if self.data.get("frozen"):
                raise self.error("frozen", "stands beside [[link]] tables", "leave it out: they hold what moves")
            return LinkTables(self, self.data["link"]).model(
                np.array([0.0, 0.0, -9.81]) if gravity is None else gravity
            )
        from armgap.arm.description.read import read_description

        key = "urdf" if "urdf" in self.data else "mjcf"
        file = self.path.parent / self._text(key)
        frozen = {joint: self._frozen(joint) for joint in self._table_or_empty("frozen")}
        base, tip = (self._text(end) if end in self.data else None for end in ("base", "tip"))
        model = read_description(file, base=base, tip=tip, frozen=frozen, expected=key.upper())
        return model if gravity is None else replace(model, chain=replace(model.chain, gravity=gravity))

    def _table_or_empty(self, name: str) -> dict[str, Any]:
        table: dict[str, Any] = self.data.get(name, {})
        return table

    def _frozen(self, joint: str) -> float:
        value = self.data["frozen"][joint]
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise self.error(f"frozen.{joint}", f"must be a finite number, not {value!r}", "give rad, or m of a slide")
        return float(value)

    def _vector(
        self, table: dict[str, Any], key: str, n: int, minimum: float | None = None, above: float | None = None
    ) -> Array:
        """Return one number per joint, in the order of the chain, from a list or from a table by joint name."""
        name = key.rpartition(".")[2]
        value = table.get(name)
        if isinstance(value, dict) and self.joints:
            for joint in value:
                if joint not in self.joints:
                    raise self.error(f"{key}.{joint}", "is not a joint of the chain", suggest(joint, self.joints))
            for joint in self.joints:
                if joint not in value:
                    raise self.error(key, f"lacks the joint `{joint}`", "give one value for each joint of the chain")
            table = {name: [value[joint] for joint in self.joints]}
        elif value is not None and self.joints and isinstance(value, list) and len(value) != n == len(self.joints):
            raise self.error(key, f"needs {n} numbers, found {len(value)}", f"one per joint: {', '.join(self.joints)}")
        return super()._vector(table, key, n, minimum, above)

    def _nominal(self, key: str, described: Array, free: Array, share: float) -> tuple[Array, Array]:
        """Return a parameter's nominal value per joint, from the arm file, else from the description, else 0, and its standard deviation.

        The standard deviation is that of the arm file, else `share` of the value, or `free` for a value of 0.
        """
        table, name = key.split(".")
        given = self._table_or_empty(table)
        n = len(self.joints)
        values = self._vector(given, key, n, minimum=0.0) if name in given else np.nan_to_num(described, nan=0.0)
        if f"sigma_{name}" in given:
            return values, self._vector(given, f"{table}.sigma_{name}", n, above=0.0)
        return values, np.where(values > 0, share * values, free)

    def _either(self, key: str, other: str, n: int) -> Array | None:
        """Return one number per joint from the key `key` or `other` of the arm file, of which at most one may be given; None without either."""
        first, second = self._optional(key, n), self._optional(other, n)
        if first is not None and second is not None:
            raise self.error(other, f"stands beside `{key}`", "give one of them")
        return second if first is None else first

    def _limited(self, model: ResolvedModel) -> Any:
        """Return the chain with the joint limits that the arm file gives."""
        chain, table, n = model.chain, self._table_or_empty("limits"), model.chain.n_joints
        keys = (("lower", "position_min"), ("upper", "position_max"), ("speed", "speed"), ("acceleration",) * 2)
        given: dict[str, Any] = {
            name: self._vector(table, f"limits.{key}", n, above=0.0 if name in ("speed", "acceleration") else None)
            for name, key in keys
            if key in table
        }
        chain = replace(chain, **given)
        for joint, low, high in zip(chain.joint_names, chain.lower, chain.upper, strict=True):
            if low > high:
                raise self.error("limits.position_max", f"of `{joint}` is below its position_min", "exchange them")
        return chain

    def _loaded(self, inertial: Array) -> tuple[Array, tuple[str, ...]]:
        """Return the links' inertial parameters with the arm file's payload on the last link, and remarks."""
        if "payload" not in self.data:
            return inertial, ()
        table = self.data["payload"]
        for key in ("mass", "com"):
            if key not in table:
                raise self.error(f"payload.{key}", "is missing", "give mass = kg and com = [x, y, z] in m")
        mass = self._scalar(table, "payload.mass", 0.0, _HEAVIEST_PAYLOAD)
        com = super()._vector(table, "payload.com", 3)
        if float(np.max(np.abs(com))) > _FURTHEST_COM:
            raise self.error("payload.com", f"is {com.tolist()} m away", "give it in m, in the last link's frame")
        inertia = np.zeros((3, 3))
        if "inertia" in table:
            inertia = symmetric(LinkTables(self, []).inertia(table["inertia"], "payload.inertia"))
        load = about_origin(mass, com, inertia)
        if wrong := inconsistency(load):
            raise self.error("payload", f"is no body: {wrong}", "correct mass, com and inertia")
        loaded = inertial.copy()
        loaded[-1] += load
        return loaded, (f"a payload of {mass:g} kg is part of the last link",)

    def _scalar(self, table: dict[str, Any], key: str, lowest: float, highest: float) -> float:
        value = table[key.rpartition(".")[2]]
        if isinstance(value, bool) or not isinstance(value, int | float) or not lowest <= value <= highest:
            raise self.error(key, f"is {value!r}, not a number from {lowest:g} to {highest:g}", "give it in SI units")
        return float(value)

    def _column_keys(self, n: int) -> list[str]:
        further = ("q_ref", "dq_ref", "tau_ff", "temp")
        return [*super()._column_keys(n), *(f"{kind}{j}" for kind in further for j in range(1, n + 1)), "tau_kind"]

    def _columns(self, n: int) -> dict[str, str]:
        return {key: name for key, name in super()._columns(n).items() if key != "tau_kind"}

    def _tau_kind(self) -> str:
        kind = str(self._table_or_empty("columns").get("tau_kind", "command"))
        if kind not in _TAU_KINDS:
            raise self.error("columns.tau_kind", f"is `{kind}`", f"write {' or '.join(_TAU_KINDS)}")
        return kind

    def _controller(self, n: int) -> Controller | None:
        if "controller" not in self.data:
            return None
        table = self.data["controller"]
        kind = table.get("kind", "pd")
        if kind != "pd":
            raise self.error("controller.kind", f"is {kind!r}", 'write kind = "pd"')
        side = table.get("kd_on", "measurement")
        if side not in get_args(DerivativeOn):
            raise self.error("controller.kd_on", f"is {side!r}", f"write {' or '.join(get_args(DerivativeOn))}")
        vectors: dict[str, Any] = {
            name: self._vector(
                table, f"controller.{name}", n, **({"above": 0.0} if name.startswith("sigma") else {"minimum": 0.0})
            )
            for name in VECTORS
            if name in table or name in ("kp", "kd")
        }
        return Controller(kd_on=side, **vectors)
