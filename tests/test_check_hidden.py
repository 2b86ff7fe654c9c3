"""Readings of a log beside an effect that nobody has named yet: what decides on them is not hidden by it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from armgap import Arm, Log, simulate
from armgap.check import Check, Corrections, examine, time_shift
from armgap.check.contradiction import Refit, Suspect, confirm
from armgap.check.equation_error import Fit
from armgap.check.readings.reading import reading
from swings import off, sines


@pytest.fixture(scope="module")
def two_links(arm: Arm) -> list[Log]:
    t = np.arange(2400) * arm.sample_period
    return [simulate(off(arm), t, sines(t, seed), noise=2e-5, seed=seed, name=f"run {seed}") for seed in (3, 4)]


def read_as(logs: list[Log], **given: object) -> list[Log]:
    corrections = Corrections.parse(**given)
    return [corrections.on_log(log) for log in logs]


def checked(logs: list[Log], arm: Arm) -> tuple[Check, ...]:
    return examine(logs[:1], logs[1:], arm).checks


@pytest.fixture(scope="module")
def loaded(arm: Arm) -> list[Log]:
    """Runs with 2 kg at 0.1 m of the second link, of which an arm file that is known to 5 % says nothing."""
    mass, distance, link, g = 2.0, 0.1, 0.45, 9.81
    change = [link**2 + distance**2, link * distance, distance**2, g * link, g * distance]
    heavy = replace(arm, theta=arm.theta + np.pad(mass * np.array(change), (0, len(arm.theta) - 5)))
    t = np.arange(2400) * arm.sample_period
    return [simulate(heavy, t, sines(t, seed), noise=2e-5, seed=seed, name=f"run {seed}") for seed in (3, 4)]


@pytest.mark.parametrize(
    ("defect", "name", "remedy"),
    [
        ({"zero": "q2=90deg"}, "position_zero", "--zero q2=-90deg"),
        ({"relative": "q2"}, "relative_angle", "--absolute q2"),
    ],
)
def test_a_load_that_the_file_does_not_know_hides_no_defect(
    loaded: list[Log], arm: Arm, defect: dict[str, str], name: str, remedy: str
) -> None:
    sure = replace(arm, sigma=0.05 * arm.theta)
    assert Refit.of(sure, loaded[:1], loaded[1:], 0.25).relative < 0.01
    assert checked(loaded, sure) == ()
    [check] = checked(read_as(loaded, **defect), sure)
    assert (check.check, check.severity) == (name, "error")
    assert remedy in check.remedies


def found_among(
    monkeypatch: pytest.MonkeyPatch, logs: list[Log], arm: Arm, stands: float, *others: tuple[str, float, float, float]
) -> list[str]:
    """What is said where the log as it stands misses by a part of the motion; others are a column that is turned over, gain, share, and miss."""

    def refit(missed: float) -> Refit:
        return Refit(arm.theta, arm.sigma, np.full(2, missed), np.ones(2))

    refits = iter([refit(stands), *(refit(missed) for *_, missed in others)])
    monkeypatch.setattr(Refit, "of", lambda *_: next(refits))
    suspects = [
        Suspect(
            reading("torque_sign", column, Corrections(flip=(column,))),
            Fit(arm.theta, np.full(2, share)),
            gain,
            closeness=math.log(share),
            unexplained=np.full(2, share),
        )
        for column, gain, share, _ in others
    ]
    found = confirm(Fit(arm.theta, np.full(2, 0.5)), suspects, logs[:1], logs[1:], arm, 0.25)
    return [] if found is None else [found.reading.what, *(other.what for other in found.alike)]


def test_what_is_hidden_may_leave_a_right_reading_without_predictions(
    monkeypatch: pytest.MonkeyPatch, two_links: list[Log], arm: Arm
) -> None:
    def said(*others: tuple[str, float, float, float]) -> list[str]:
        return found_among(monkeypatch, two_links, arm, 0.9, *others)

    assert said(("tau1", 1.5, 0.06, 0.55)) == ["tau1"], "the torques are explained"
    assert said(("tau1", 1.5, 0.2, 0.25)) == ["tau1"], "the motion is predicted"
    assert said(("tau1", 1.5, 0.2, 0.55)) == [], "neither"
    assert said(("tau1", 1.5, 0.06, 0.7)) == [], "no better than the log as it stands"
    assert said(("tau1", 0.5, 0.06, 0.6)) == [], "predictions and torques together say too little"
    standing = found_among(monkeypatch, two_links, arm, 7.0, ("tau1", 1.5, 0.06, 1.8))
    assert standing == [], "worse than an arm that stands still"


def test_predictions_and_torques_choose_a_reading_together(
    monkeypatch: pytest.MonkeyPatch, two_links: list[Log], arm: Arm
) -> None:
    def said(*others: tuple[str, float, float, float]) -> list[str]:
        return found_among(monkeypatch, two_links, arm, 0.9, *others)

    assert said(("tau1", 0.9, 0.06, 0.58), ("tau2", 0.35, 0.08, 0.52)) == ["tau1"], "predictions hardly tell them apart"
    assert said(("tau1", 0.9, 0.06, 0.5), ("tau2", 0.5, 0.01, 0.1)) == ["tau2"], "they do"
    assert said(("tau1", 0.9, 0.01, 0.1), ("tau2", 0.88, 0.01, 0.1)) == ["tau1", "tau2"], "nothing does"


def test_a_shift_that_asks_for_an_arm_that_nobody_has_is_none(
    monkeypatch: pytest.MonkeyPatch, two_links: list[Log], arm: Arm
) -> None:
    def shifted(theta: np.ndarray) -> Corrections | None:
        misses = iter([1.0, 1.0, 0.1, 0.5])

        def refit(*_: object) -> Refit:
            missed = next(misses, 1.0)
            return Refit(theta if missed < 1.0 else arm.theta, np.zeros(len(theta)), np.full(2, missed), np.ones(2))

        monkeypatch.setattr(Refit, "of", refit)
        return time_shift.confirmed(0, two_links[:1], two_links[1:], arm, 0.25)

    light = np.where(np.arange(len(arm.theta)) == 3, -0.1, 1.0) * arm.theta
    assert shifted(arm.theta) is not None
    assert shifted(light) is None
