"""Random choices of training logs, holdout and horizon, and the count of what is named."""

from __future__ import annotations

from tests.log_splits.draws import HORIZONS, MOST_HOLDOUT, MOST_TRAINING, draw, named


def test_no_log_is_in_both_parts_and_every_size_is_drawn() -> None:
    draws = [draw(7, number, 10) for number in range(200)]
    assert draws == [draw(7, number, 10) for number in range(200)]
    for training, holdout, horizon in draws:
        assert training
        assert holdout
        assert not set(training) & set(holdout)
        assert set(training) | set(holdout) <= set(range(10))
        assert horizon in HORIZONS
    assert {len(training) for training, _, _ in draws} == set(range(1, MOST_TRAINING + 1))
    assert {len(holdout) for _, holdout, _ in draws} == set(range(1, MOST_HOLDOUT + 1))
    assert all(len(draw(7, number, 2)[0]) == 1 for number in range(20))


def test_names_are_counted_with_those_that_are_sure() -> None:
    def record(*causes: tuple[str, int, float]) -> dict[str, object]:
        return {"causes": [{"effect": e, "joint": j, "probability": p} for e, j, p in causes]}

    records = [
        record(("rotor_inertia", 2, 0.8)),
        record(("rotor_inertia", 2, 0.4), ("actuator_lag", 2, 0.5)),
        {"failed": "x"},
    ]
    assert named(records) == [
        "2 of 3 draws answered; named",
        "rotor_inertia 2: 2, with 0.5 or more 1",
        "actuator_lag 2: 1, with 0.5 or more 1",
    ]
