"""Sampling of a log: rate, jitter, gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armgap.log.log import Log

__all__ = ["Sampling", "sampling"]

GAP_PERIODS = 3.0
"""Length of a hole in the samples, in sample periods, from which it counts as a gap."""

#: Largest number of gaps that are listed.
_LISTED_GAPS = 5


@dataclass(frozen=True)
class Sampling:
    """Sampling of a log: rate, jitter and gaps.

    Attributes
    ----------
    samples : int
        Number of samples.
    duration_s, period_s, rate_hz : float
        Duration of the log [s], median sample period [s], and sample rate [Hz], the inverse of the period.
    jitter_s, jitter_max_s : float
        Standard deviation of the sample periods without gaps, and their largest difference from the median [s].
    gaps : int
        Number of holes in the samples longer than three periods.
    gap_s : float
        Sum of the gaps' lengths [s].
    widest : tuple of (float, float)
        Time and length of the widest gaps, five at most, the widest first [s].
    """

    samples: int
    duration_s: float
    period_s: float
    rate_hz: float
    jitter_s: float
    jitter_max_s: float
    gaps: int
    gap_s: float
    widest: tuple[tuple[float, float], ...]


def sampling(log: Log) -> Sampling:
    """Return rate, jitter and gaps of a log's samples."""
    steps = np.diff(log.t)
    period = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP_PERIODS * period)
    even = steps if not len(gaps) else np.delete(steps, gaps)
    widest = gaps[np.argsort(steps[gaps])[::-1][:_LISTED_GAPS]]
    return Sampling(
        samples=len(log),
        duration_s=log.duration,
        period_s=period,
        rate_hz=1.0 / period,
        jitter_s=float(np.std(even)),
        jitter_max_s=float(max(even.max() - period, period - even.min())),
        gaps=len(gaps),
        gap_s=float(steps[gaps].sum()),
        widest=tuple((float(log.t[k]), float(steps[k])) for k in widest),
    )
