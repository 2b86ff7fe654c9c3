"""An exported arm moves in MuJoCo as the diagnosis predicts; `python -m tests.back_into_simulator` does this for five arms."""

from __future__ import annotations

import pytest

pytest.importorskip("mujoco")

from tests.back_into_simulator.__main__ import CLOSE, compare
from tests.back_into_simulator.cases import make


@pytest.mark.parametrize("number", [0, 1])
def test_the_gap_in_mujoco_is_that_of_the_diagnosis(number: int) -> None:
    answer = compare(make(3, number))
    assert answer.verdict != "input"
    for after, mjcf, _, told in answer.gaps:
        assert mjcf == pytest.approx(after, rel=CLOSE)
        assert told == pytest.approx(after, rel=CLOSE)
