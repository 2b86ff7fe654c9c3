"""Bias and coverage of the estimated base parameters over the runs, as tables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Record = dict[str, Any]

#: Median relative standard deviation below which a base parameter counts as determined by the motion.
DETERMINED = 0.1
#: Targets: largest bias as a share of the value or in standard errors of the mean, and range of the share of 95 % intervals that hold the truth.
BIAS, ERRORS, COVERAGE = 0.05, 2.0, (0.92, 0.98)
#: Half of a 95 % interval, in standard deviations.
_REACH = 1.959963984540054


@dataclass(frozen=True)
class Summary:
    """Comparison of estimated base parameters with the truth over the runs, for those parameters that motion determines.

    Attributes
    ----------
    names : tuple of str
        Names of the base parameters that motion determines.
    sigma : ndarray, shape (n_determined,)
        Median standard deviation of the estimates, as a share of the value.
    bias, error : ndarray, shape (n_determined,)
        Mean error of the estimates as a share of the value, and the standard error of that mean.
    scatter : ndarray, shape (n_determined,)
        RMS over the runs of the error minus its mean, in units of the standard deviation that the run's estimate was given.
    held : ndarray, shape (n_determined,)
        Share of the runs whose 95 % interval holds the true value.
    """

    names: tuple[str, ...]
    sigma: Array
    bias: Array
    error: Array
    scatter: Array
    held: Array

    @property
    def unbiased(self) -> NDArray[np.bool_]:
        """Whether the bias of each parameter meets its target."""
        return np.asarray((np.abs(self.bias) <= BIAS) | (np.abs(self.bias) <= ERRORS * self.error))

    @property
    def coverage(self) -> float:
        """Share of the 95 % intervals of all parameters and runs that hold the true value."""
        return float(np.mean(self.held)) if len(self.held) else float("nan")


def summary(records: list[Record], condition: str, estimate: str = "estimate", sigma: str = "sigma") -> Summary:
    """Compare the estimates from one kind of logs with the truth.

    Parameters
    ----------
    records : list of dict
        Records that `estimates.ask` returned, two or more.
    condition : {"quiet", "disturbed"}
        Logs without or with the disturbance.
    estimate, sigma : str
        Keys of estimates and standard deviations in the records' entry for the condition.
    """
    truth = np.array(records[0]["truth"])
    found, given = (np.array([record[condition][key] for record in records]) for key in (estimate, sigma))
    size = np.median(given, axis=0)
    known = np.flatnonzero(size < DETERMINED * np.abs(truth))
    truth, found, given, size = truth[known], found[:, known], given[:, known], size[known]
    off = found - np.mean(found, axis=0)
    freedom = len(records) - 1
    return Summary(
        tuple(records[0]["names"][i] for i in known),
        size / np.abs(truth),
        np.mean(found - truth, axis=0) / np.abs(truth),
        np.sqrt(np.sum(off**2, axis=0) / freedom / len(records)) / np.abs(truth),
        np.sqrt(np.sum((off / given) ** 2, axis=0) / freedom),
        np.mean(np.abs(found - truth) <= _REACH * given, axis=0),
    )


def report(records: list[Record]) -> str:
    """Return the tables of bias and coverage as text."""
    failed = [r for r in records if "failed" in r]
    answers = [r for r in records if "failed" not in r]
    lines = [f"{len(answers)} runs, {len(failed)} failed", *(f"run {r['number']}: {r['failed']}" for r in failed), ""]
    if len(answers) < 2:
        return "\n".join(lines).rstrip()
    titles = {
        "quiet": "encoder steps alone",
        "disturbed": f"torque disturbance of {100 * answers[0]['share']:g} % in the loop",
    }
    for condition, title in titles.items():
        found = summary(answers, condition)
        lines += [f"diagnosis, {title}", *_table(found), *_verdict(found), ""]
        spoke = [check for r in answers for check in r[condition]["checks"]]
        if spoke:
            lines += [f"checks of the input that spoke: {', '.join(sorted(set(spoke)))} ({len(spoke)})", ""]
    apart = np.array([np.subtract(r["single"], r["disturbed"]["estimate"]) / r["disturbed"]["sigma"] for r in answers])
    differ = float(np.sqrt(np.mean(apart**2)))
    lines += [f"estimates with every single parameter free differ by {differ:.2f} standard deviations (RMS)", ""]
    for condition, title in titles.items():
        found = summary(answers, condition, "identified", "identified_sigma")
        lines += [f"recursive least squares, {title}", *_verdict(found), ""]
    return "\n".join(lines).rstrip()


def _table(found: Summary) -> list[str]:
    rows = [["parameter", "sigma %", "bias %", "of its errors", "scatter", "held %", ""]]
    for i in np.argsort(-np.abs(found.bias / found.error)):
        rows.append([
            found.names[i], f"{100 * found.sigma[i]:.2f}", f"{100 * found.bias[i]:+.2f}", f"{found.bias[i] / found.error[i]:+.1f}",
            f"{found.scatter[i]:.2f}", f"{100 * found.held[i]:.0f}", "" if found.unbiased[i] else "biased",
        ])  # fmt: skip
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = [
        "  ".join(cell.rjust(w) if i else cell.ljust(w) for i, (cell, w) in enumerate(zip(row, widths, strict=True)))
        for row in rows
    ]
    return [line.rstrip() for line in lines]


def _verdict(found: Summary) -> list[str]:
    """Return how many parameters meet the targets; by chance one parameter in ten has fewer than 46 of 50 intervals that hold the truth."""
    count, (low, high) = len(found.names), COVERAGE
    if not count:
        return ["no base parameter is determined"]
    below, above = np.sum(found.held < low), np.sum(found.held > high)
    significant = np.sum(np.abs(found.bias) > ERRORS * found.error)
    in_errors = np.sqrt(np.mean((found.bias / found.error) ** 2))
    return [
        f"{count} parameters determined; bias within {100 * BIAS:g} % or {ERRORS:g} standard errors: {np.sum(found.unbiased)}",
        f"bias above {ERRORS:g} standard errors: {significant}; largest {100 * np.max(np.abs(found.bias)):.1f} %; "
        f"RMS in standard errors {in_errors:.2f}",
        f"scatter over the given standard deviation: {np.sqrt(np.mean(found.scatter**2)):.2f} (RMS)",
        f"95 % intervals that hold the truth: {100 * found.coverage:.1f} % of all; of single parameters {below} below {100 * low:g} %, "
        f"{above} above {100 * high:g} %, least {100 * np.min(found.held):.0f} %",
    ]
