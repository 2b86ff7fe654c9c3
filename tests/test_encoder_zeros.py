"""Encoder zeros that differ between recordings: fitted, said, and no cause; what all recordings share is one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from armgap import Arm, Diagnosis, Log, diagnose
from armgap.report.sections.about import data_quality
from swings import swing

ZEROS_RAD = np.array([0.03, -0.02, -0.01])
HOLDOUT_RAD = 0.025


def shifted(log: Log, zero: float) -> Log:
    """The log of an encoder that shows so much where the pendulum hangs down."""
    return replace(log, q=log.q + zero)


def asked(arm: Arm, shared: float) -> Diagnosis:
    training = [shifted(swing(arm, seed), shared + zero) for seed, zero in enumerate(ZEROS_RAD, start=1)]
    return diagnose(training, arm, holdout=shifted(swing(arm, 9), shared + HOLDOUT_RAD))


@pytest.fixture(scope="module")
def scattered(pendulum: Arm) -> Diagnosis:
    return asked(pendulum, 0.0)


def zeros(data: dict[str, Any], use: str) -> tuple[np.ndarray, np.ndarray]:
    found = [log["encoder_zero"] for log in data[use]]
    assert all(zero["unit"] == "rad" for zero in found)
    return np.array([z["value"][0] for z in found]), np.array([z["sigma"][0] for z in found])


@pytest.mark.slow
@pytest.mark.parametrize(("use", "wanted"), [("training", ZEROS_RAD), ("holdout", np.array([HOLDOUT_RAD]))])
def test_zeros_are_found(scattered: Diagnosis, use: str, wanted: np.ndarray) -> None:
    found, sigma = zeros(scattered.to_dict(), use)
    # What all training recordings share is known to no better than one recording's zero.
    assert np.all(np.abs(found - wanted) < 4 * sigma + 5e-4)


def test_zeros_are_no_cause(scattered: Diagnosis) -> None:
    assert scattered.verdict in ("none", "parameters")
    assert not scattered.causes
    assert not scattered.candidates


def test_the_gap_beside_known_zeros_is_said(scattered: Diagnosis) -> None:
    halves = scattered.gap.second_halves
    assert halves is not None
    assert halves.with_zeros[0] < 0.2 * halves.after[0]
    assert any("zeros differ between recordings" in note for note in scattered.remarks)
    columns = data_quality(scattered.to_dict()).tables[0].header
    assert columns[-1] == "encoder zeros [mrad]"


@pytest.mark.slow
def test_what_all_recordings_share_is_a_cause(pendulum: Arm) -> None:
    """On a pendulum, of the encoder or of gravity: both turn its weight."""
    first = asked(pendulum, 0.06).causes[0]
    assert first.effect in ("encoder_offset", "base_tilt")
    [turned] = first.parameters.values()
    # The mean of three zeros is known to their scatter over the root of three.
    assert abs(turned.value) == pytest.approx(0.06, abs=np.std(ZEROS_RAD, ddof=1) / np.sqrt(3))


def test_one_recording_has_no_zeros_of_its_own(pendulum: Arm) -> None:
    data = diagnose(shifted(swing(pendulum, 1), 0.03), pendulum).to_dict()
    assert all("encoder_zero" not in log for use in ("training", "holdout") for log in data[use])
    assert "second_halves" not in data["gap"]


@pytest.mark.slow
def test_parts_of_one_recording_share_its_zero(pendulum: Arm) -> None:
    """Without a holdout the last part of every training log is held out: its zero is known."""
    logs = [shifted(swing(pendulum, seed), zero) for seed, zero in enumerate(ZEROS_RAD, start=1)]
    data = diagnose(logs, pendulum).to_dict()
    assert zeros(data, "training")[0] == pytest.approx(zeros(data, "holdout")[0], abs=0)
    assert "second_halves" not in data["gap"]
