"""Custom effects in a diagnosis: a function of time, position, velocity and torque that is ranked like an effect of the library.

The function is evaluated along the measured motion and gives a torque per unit of size; armgap fits the size together with the arm's
parameters and judges it like any effect of the library. The function returns an array of torques and may compute it in any way, from a
table or from a model.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap import _native
from armgap.errors import OptionError
from armgap.log.log import Log

__all__ = ["CustomEffect"]

Array = NDArray[np.float64]
#: Largest number of custom effects in one diagnosis.
MAX_CUSTOM_EFFECTS = 4
#: Half width, in samples, of the local cubic that gives velocities where a log has none.
_VELOCITY_HALF_WIDTH = 4
_NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class CustomEffect:
    """An effect whose torque is a function given by the user.

    Parameters
    ----------
    name : str
        Name of the effect in results: small letters, digits, underscores; not the name of an effect of the library.
    joint : int
        Joint that the effect acts on, from 1.
    torque : callable
        ``torque(t, q, dq, tau)`` with times of shape (n_samples,) [s], counted from the log's first sample, and positions, velocities and
        torques of shape (n_samples, n_joints), SI. It returns the torque on the joint, shape (n_samples,) [N m or N], for size 1. A
        torque that resists the motion has the opposite sign of the velocity.

    Examples
    --------
    >>> import numpy as np
    >>> drag = CustomEffect("fan_drag", 2, lambda t, q, dq, tau: -np.abs(dq[:, 1]) ** 1.5 * np.sign(dq[:, 1]))
    >>> drag.joint
    2
    """

    name: str
    joint: int
    torque: Callable[[Array, Array, Array, Array], Any]


def check_effects(effects: Any) -> None:
    """Raise if a sequence holds anything but custom effects.

    Raises
    ------
    OptionError
        If an item is no custom effect; the message shows the first one.
    """
    for effect in (effects,) if isinstance(effects, str | CustomEffect) else effects:
        if not isinstance(effect, CustomEffect) or effect is effects:
            remedy = "give a list of armgap.CustomEffect; effects of the library are looked for by themselves"
            raise OptionError(f"`effects` holds {effect!r}", remedy=remedy)


@dataclass(frozen=True)
class TorqueTables:
    """Custom effects evaluated on the logs of a diagnosis.

    Attributes
    ----------
    effects : tuple of CustomEffect
        Effects in the order given.
    scale : tuple of float
        RMS of each effect's torque over the training logs, by which the effect's tables are divided.
    by_log : dict of str to list of ndarray
        Torque tables of the effects for each log, by name of the log.
    """

    effects: tuple[CustomEffect, ...]
    scale: tuple[float, ...]
    by_log: dict[str, list[Array]]

    @classmethod
    def of(cls, effects: Sequence[CustomEffect], training: Sequence[Log], held: Sequence[Log]) -> TorqueTables:
        """Evaluate custom effects along training and holdout logs.

        Raises
        ------
        OptionError
            If a name is taken or impossible, a joint does not exist, or a function does not return one finite torque per sample.
        """
        _check(effects, training[0].n_joints)
        raw = {log.name: [_evaluated(e, log) for e in effects] for log in (*training, *held)}
        scale = []
        for i, effect in enumerate(effects):
            rms = float(np.sqrt(np.mean(np.concatenate([raw[log.name][i] for log in training]) ** 2)))
            if rms == 0.0:
                raise OptionError(f"effect {effect.name!r} is zero all along the training logs", remedy="leave it out")
            scale.append(rms)
        return cls(
            tuple(effects),
            tuple(scale),
            {name: [x / s for x, s in zip(tables, scale, strict=True)] for name, tables in raw.items()},
        )

    def named(self, data: dict[str, Any]) -> dict[str, Any]:
        """Return a diagnosis' JSON object with the user's names of custom effects, and sizes in units of the user's functions."""
        for i, effect in enumerate(self.effects):
            _rename(data, f"user_effect_{i + 1}", effect.name, 1.0 / self.scale[i])
        return data

    def applied(self, data: dict[str, Any], logs: Sequence[Log]) -> tuple[dict[str, Any], list[Log]]:
        """Return a diagnosis without custom causes, and logs with the torques of these causes added, for code that knows only library effects."""
        custom = {e.name: (i, e.joint) for i, e in enumerate(self.effects)}
        found = [c for c in data["causes"] if c["effect"] in custom]
        if not found:
            return data, list(logs)
        changed = []
        for log in logs:
            tau = log.tau.copy()
            for cause in found:
                i, joint = custom[cause["effect"]]
                tau[:, joint - 1] += cause["parameters"]["size"]["value"] * self.scale[i] * self.by_log[log.name][i]
            changed.append(replace(log, tau=tau))
        rest = deepcopy(data)
        rest["causes"] = [c for c in rest["causes"] if c["effect"] not in custom]
        return rest, changed


def _check(effects: Sequence[CustomEffect], joints: int) -> None:
    if len(effects) > MAX_CUSTOM_EFFECTS:
        raise OptionError(
            f"{len(effects)} custom effects were given", remedy=f"give at most {MAX_CUSTOM_EFFECTS} at once"
        )
    taken = {e["name"] for e in _native.effects()}
    for effect in effects:
        if not _NAME.fullmatch(effect.name):
            raise OptionError(
                f"an effect cannot be called {effect.name!r}", remedy="use small letters, digits and underscores"
            )
        if effect.name in taken:
            raise OptionError(f"there is another effect called {effect.name!r}", remedy="choose another name")
        if not 1 <= effect.joint <= joints:
            raise OptionError(
                f"effect {effect.name!r} is placed on joint {effect.joint}", remedy=f"give a joint from 1 to {joints}"
            )
        taken.add(effect.name)


def _evaluated(effect: CustomEffect, log: Log) -> Array:
    fix = np.ascontiguousarray
    dq = log.dq if log.dq is not None else _native.velocity(fix(log.t), fix(log.q), "local-cubic", _VELOCITY_HALF_WIDTH)
    torque = np.asarray(effect.torque(log.t - log.t[0], log.q, dq, log.tau), dtype=float)
    if torque.shape != log.t.shape:
        raise OptionError(
            f"effect {effect.name!r} gives an array of shape {torque.shape} for log {log.name!r}",
            remedy=f"return one torque per sample, shape {log.t.shape}",
        )
    wrong = np.flatnonzero(~np.isfinite(torque))
    if wrong.size:
        raise OptionError(
            f"effect {effect.name!r} is {torque[wrong[0]]} at sample {wrong[0]} of log {log.name!r}",
            remedy="return finite torques everywhere",
        )
    return fix(torque)


def _rename(node: Any, internal: str, name: str, unit: float) -> None:
    """Replace an internal effect name in a JSON object by the user's name, and scale its sizes by `unit`."""
    if isinstance(node, list):
        for item in node:
            _rename(item, internal, name, unit)
    elif isinstance(node, dict):
        if node.get("effect") == internal:
            node["effect"] = name
            if "title" in node:
                node["title"] = name.replace("_", " ")
            size = (node.get("parameters") or {}).get("size")
            for entry in filter(None, (size, node.get("bound"))):
                entry["value"], entry["unit"] = entry["value"] * unit, "1"
                if "sigma" in entry:
                    entry["sigma"] *= unit
        for item in node.values():
            _rename(item, internal, name, unit)
