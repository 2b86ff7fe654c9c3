"""Laws of a drive that no effect of the library has, each with the torque that it adds to the command (mostly takes from it).

A drive may change its torque at a limited rate, deliver less at speed, or have another limit in either direction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armgap.check.drive_limit import slewed
from armgap.log.log import Log

__all__ = ["WORDS", "DriveLaw", "all_laws", "frequent_laws", "speed"]

Array = NDArray[np.float64]

#: Time over which velocities are averaged [s].
_SPEED_S = 0.01
#: Times that a drive needs for the range of its commands at the rates that are tried [s].
_SLEW_TIMES = tuple(0.01 * 1.25**k for k in range(31))
#: Quantiles of the torque at which limits of either direction are tried.
_LIMITS = (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.975, 1.0)
#: Torques at standstill, and their decrease up to the log's speeds, relative to the largest torque, of limits that fall with the speed.
_STALL = (*np.arange(0.3, 1.11, 0.05), 1.2, 1.3, 1.5, 1.7, 2.0, 2.5, 3.0, 4.0)
_FALL = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0)
#: What each law of a drive is, in words, by its name in results.
WORDS = {
    "torque_rate_limit": "a drive whose torque changes by at most {:.3g} {}/s does the same",
    "torque_speed_limit": "a limit of the torque that falls with the speed, as by the supply voltage, does the same",
    "torque_asymmetric_limit": "a drive with limits of {:.3g} and -{:.3g} {} does the same",
}


@dataclass(frozen=True)
class DriveLaw:
    """A law of one joint's drive along some logs.

    Attributes
    ----------
    name : str
        Name of the law in results.
    values : tuple of float
        Values of the law [SI].
    added : list of ndarray
        Torque that the law adds to the command of the joint, log by log [N m or N].
    """

    name: str
    values: tuple[float, ...]
    added: list[Array]

    def in_words(self, unit: str) -> str:
        """Return what the law is; `unit` is that of the joint's torque."""
        return WORDS[self.name].format(*self.values, unit)


def frequent_laws(logs: Sequence[Log], j: int) -> Iterator[DriveLaw]:
    """Yield the laws of joint `j` (from 0) that may act most of the time: limits of rate, and coarsely those that fall with the speed."""
    yield from _rates(logs, j)
    yield from _falling(logs, j, _STALL[::2], _FALL[2::2])


def all_laws(logs: Sequence[Log], j: int) -> Iterator[DriveLaw]:
    """Yield all laws of joint `j` (from 0) that are tried."""
    yield from _rates(logs, j)
    yield from _falling(logs, j, _STALL, _FALL)
    yield from _two_limits(logs, j)


def _rates(logs: Sequence[Log], j: int) -> Iterator[DriveLaw]:
    """Yield limits of the rate of torque."""
    tau = [log.tau[:, j] for log in logs]
    rates = max(float(np.ptp(x)) for x in tau) / np.array(_SLEW_TIMES)
    behind = [slewed(log.t, x, rates) for log, x in zip(logs, tau, strict=True)]
    for k, rate in enumerate(rates):
        yield DriveLaw("torque_rate_limit", (float(rate),), [x[k] - u for x, u in zip(behind, tau, strict=True)])


def _falling(logs: Sequence[Log], j: int, stall: Sequence[float], fall: Sequence[float]) -> Iterator[DriveLaw]:
    """Yield limits that fall with the speed in the direction of the torque."""
    tau = [log.tau[:, j] for log in logs]
    speeds = [speed(log, j) for log in logs]
    top = float(np.abs(np.concatenate(tau)).max())
    fast = float(np.quantile(np.abs(np.concatenate(speeds)), 0.99))
    if top == 0.0 or fast == 0.0:
        return
    for slope in fall:
        for level in stall:
            limits = [
                np.where(x * v > 0.0, np.maximum(level - slope * np.abs(v) / fast, 0.0) * top, np.inf)
                for x, v in zip(tau, speeds, strict=True)
            ]
            added = [np.clip(x, -limit, limit) - x for x, limit in zip(tau, limits, strict=True)]
            yield DriveLaw("torque_speed_limit", (level * top, slope * top / fast), added)


def _two_limits(logs: Sequence[Log], j: int) -> Iterator[DriveLaw]:
    """Yield limits that differ by direction."""
    tau = [log.tau[:, j] for log in logs]
    whole = np.concatenate(tau)
    if whole.max() <= 0.0 or whole.min() >= 0.0:
        return
    for up in np.quantile(whole[whole > 0.0], _LIMITS):
        for down in np.quantile(-whole[whole < 0.0], _LIMITS):
            yield DriveLaw(
                "torque_asymmetric_limit", (float(up), float(down)), [np.clip(x, -down, up) - x for x in tau]
            )


def speed(log: Log, j: int) -> Array:
    """Return the velocity of joint `j` (from 0), averaged over `_SPEED_S`."""
    width = max(round(_SPEED_S / log.sample_period), 1)
    return np.convolve(np.gradient(log.q[:, j], log.t), np.full(width, 1.0 / width), "same")
