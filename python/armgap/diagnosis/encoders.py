"""What the difference of a joint's two encoders depends on: the torque of the transmission between them, or speed and angle, as an encoder's error.

A shaft is deflected by the torque that it transmits (Spong 1987) and a play by the sign of this torque. An encoder that answers late, or whose
positions are low-passed, differs from the other one by its delay times the speed; one whose disc is off centre by a sine of the angle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armgap.log.log import Log

__all__ = ["error_of_encoder"]

Array = NDArray[np.float64]

#: Length of the moving mean, taken twice, of all signals that are compared [s].
_SMOOTH_S = 0.03
#: Lengths of the moving mean that a log has to exceed: four go to its ends.
_FEWEST_WIDTHS = 10
#: Share of the difference's variance from which speed or angle explain it: 0.99 and more for late and low-passed encoders, and those off centre, of
#: a simulator of another hand.
_TELLS = 0.95
#: Largest ratio of what speed or angle leave of the difference to what the transmission's torque leaves of it.
_BETTER = 0.5
#: Part of the largest torque, and of the largest speed, within which the sign of friction and of a play is rounded.
_ROUNDED = 0.03


def error_of_encoder(logs: Sequence[Log], joint: int) -> str | None:
    """Return in words the error of one of a joint's encoders that their difference shows; None if a transmission explains it as well.

    Parameters
    ----------
    logs : sequence of Log
        Logs that hold `q_link`.
    joint : int
        The joint, from 0.
    """
    parts = [_signals(log, joint) for log in logs if log.q_link is not None and len(log) > _FEWEST_WIDTHS * _width(log)]
    if not parts:
        return None
    apart, speed, acceleration, torque, angle = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    sign = np.tanh(torque / max(_ROUNDED * float(np.abs(torque).max()), 1e-30))
    against = np.tanh(speed / max(_ROUNDED * float(np.abs(speed).max()), 1e-30))
    of_transmission, _ = _left(apart, [torque, sign, against, acceleration])
    late, slope = _left(apart, [speed])
    off_centre, (sine, cosine) = _left(apart, [np.sin(angle), np.cos(angle)])
    left = min(late, off_centre)
    if left > min(1.0 - _TELLS, _BETTER * of_transmission):
        return None
    if late <= off_centre:
        first, second = ("first", "second") if slope[0] < 0.0 else ("second", "first")
        return f"the {first} encoder is {1e3 * abs(slope[0]):.3g} ms behind the {second} one, as by a delay or a filter of its positions"
    return f"one of the encoders is off by {1e3 * np.hypot(sine, cosine):.3g} mrad times a sine of the angle, as by a disc off centre"


def _width(log: Log) -> int:
    """Return the length of the moving mean in samples."""
    return max(round(_SMOOTH_S / log.sample_period), 1)


def _signals(log: Log, joint: int) -> tuple[Array, ...]:
    """Return difference of the encoders, speed, acceleration, torque and angle of a joint, smoothed."""
    assert log.q_link is not None
    link = log.q_link[:, joint]
    torque = (log.tau if log.tau_meas is None else log.tau_meas)[:, joint]
    width = _width(log)
    inner = slice(2 * width, -2 * width)
    kernel = np.convolve(np.full(width, 1.0 / width), np.full(width, 1.0 / width))
    apart, angle, torque = (np.convolve(x, kernel, "same") for x in (log.q[:, joint] - link, link, torque))
    speed = np.gradient(angle, log.t)
    return tuple(x[inner] for x in (apart, speed, np.gradient(speed, log.t), torque, angle))


def _left(values: Array, columns: Sequence[Array]) -> tuple[float, Array]:
    """Return the share of the variance of `values` that a constant and `columns` leave, and the coefficients of the columns."""
    regressor = np.column_stack([np.ones_like(values), *columns])
    found = np.linalg.lstsq(regressor, values, rcond=None)[0]
    share = float(np.var(values - regressor @ found)) / max(float(np.var(values)), 1e-30)
    return share, np.asarray(found[1:])
