"""Laws of drives and of friction in place of pushes, lags and delays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from armgap import Arm, Log, simulate
from armgap.check.drive_limit import slewed
from armgap.diagnosis.drive_laws import all_laws
from armgap.diagnosis.laws_in_place import LawInPlace, doubt, laws_in_place, say_withheld, withheld
from armgap.report.pushes import times_of_pushes

PERIOD = 0.002
TIMES = PERIOD * np.arange(4000)
PENDULUM = Arm("bench", "pendulum", 9.81, PERIOD, [0.1, 2.0, 0.05, 0.1], sigma=[0.01, 0.2, 0.03, 0.05])


def pushed(
    time: float, impulse: float, duration: float = 0.1, joint: int = 1, probability: float = 0.9
) -> dict[str, Any]:
    """Return a push as a diagnosis has it."""
    values = {"time": time, "duration": duration, "impulse": impulse}
    parameters = {name: {"value": value} for name, value in values.items()}
    return {
        "effect": "external_pulse", "joint": joint, "log": "run", "probability": probability, "equivalents": [], "parameters": parameters,
    }  # fmt: skip


def found(causes: list[dict[str, Any]], tau: NDArray[np.float64], q: NDArray[np.float64]) -> list[LawInPlace]:
    """Return the laws in place of the causes of one log of a pendulum."""
    return laws_in_place({"causes": causes}, [Log("run", TIMES, q[:, None], tau[:, None], None)], PENDULUM)


def impulses(missing: NDArray[np.float64], threshold: float) -> list[dict[str, Any]]:
    """Return what is missing from the torque as pushes, where it is more than a threshold in size."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (np.abs(missing) > threshold).astype(int), [0]])))
    pairs = list(zip(edges[::2], edges[1::2], strict=True))
    return [
        pushed(TIMES[(a + b) // 2], float(missing[a:b].sum() * PERIOD), float((b - a) * PERIOD))
        for a, b in pairs
        if b - a > 5
    ]


def swung(torque: Callable[[int, float, float], float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions and delivered torques of the pendulum under a torque of sample, position and velocity."""
    inertia, weight, viscous, coulomb = PENDULUM.theta
    q, dq, step = 0.0, 0.0, 0.25 * PERIOD
    positions, delivered = np.empty(len(TIMES)), np.empty(len(TIMES))
    for k in range(len(TIMES)):
        positions[k], delivered[k] = q, torque(k, q, dq)
        for _ in range(4):
            dq += step * (delivered[k] - weight * np.sin(q) - viscous * dq - coulomb * np.tanh(dq / 0.05)) / inertia
            q += step * dq
    return positions, delivered


@pytest.mark.parametrize("name", ["torque_speed_limit", "torque_asymmetric_limit"])
def test_a_law_of_the_drive_gives_the_impulses_of_all_pushes(name: str) -> None:
    tau = 2.0 * np.cos(2 * np.pi * 0.31 * TIMES + 0.4) + 1.0 * np.cos(2 * np.pi * 0.83 * TIMES)

    def limited(k: int, q: float, dq: float) -> float:
        if name == "torque_asymmetric_limit":
            return float(np.clip(tau[k], -2.2, 2.7))
        limit = max(2.6 - 0.5 * abs(dq), 0.0) if tau[k] * dq > 0.0 else np.inf
        return float(np.clip(tau[k], -limit, limit))

    q, delivered = swung(limited)
    missing = delivered - tau
    pushes = impulses(missing, 0.02)
    assert len(pushes) >= 3
    (law,) = found(pushes, tau, q)
    assert (law.name, law.joint, law.throughout) == (name, 1, False)
    assert law.factor == 0.5 ** len(pushes)
    apart = {effect for effect, joint, _ in withheld({"causes": pushes}, [law]) if joint == 1}
    assert apart == {"external_pulse", "actuator_lag", "actuator_delay"}, "no lag takes up what the pushes were"
    stretches = [push | {"log": f"run ({2 * i} to {2 * i + 2} s)"} for i, push in enumerate(pushes)]
    assert [other.name for other in found(stretches, tau, q)] == [name], "in stretches of the log"
    # Where the motion is that of the whole command, the law has the impulses and explains no torque.
    free, _ = swung(lambda k, _, __: float(tau[k]))
    assert all(other.name == "uneven_friction" for other in found(pushes, tau, free))


def test_a_limit_of_one_direction_stands_behind_the_named_limit_of_the_other() -> None:
    tau = 3.0 * np.cos(2 * np.pi * 0.31 * TIMES + 0.4)
    limited = np.clip(tau, -2.4, 2.4)
    q, delivered = swung(lambda k, _, __: float(np.clip(limited[k], -2.4, 1.9)))
    pushes = impulses(delivered - limited, 0.02)
    assert len(pushes) >= 2
    saturation = {
        "effect": "torque_saturation",
        "joint": 1,
        "probability": 1.0,
        "parameters": {"level": {"value": 2.4}},
    }
    (law,) = found([saturation, *pushes], tau, q)
    assert law.name == "torque_asymmetric_limit"
    up = float(law.why.split("limits of ")[1].split()[0])
    assert up == pytest.approx(1.9, rel=0.1)


def test_a_controller_that_answers_pushes_is_no_limit_of_its_drive() -> None:
    reference = 0.5 * np.sin(2 * np.pi * 0.4 * TIMES)
    pushes = [pushed(time, impulse) for time, impulse in ((1.5, 0.3), (3.1, 0.25), (5.2, 0.35))]
    given = np.zeros(len(TIMES))
    for push in pushes:
        time, duration, impulse = (push["parameters"][key]["value"] for key in ("time", "duration", "impulse"))
        given[np.abs(TIMES - time) <= 0.5 * duration] = impulse / duration
    rate = np.gradient(reference, TIMES)

    def commanded(k: int, q: float, dq: float) -> float:
        return float(40.0 * (reference[k] - q) + 4.0 * (rate[k] - dq))

    q, delivered = swung(lambda k, q, dq: commanded(k, q, dq) + given[k])
    tau = delivered - given
    behind = [law for law in all_laws([Log("run", TIMES, q[:, None], tau[:, None], None)], 0)]
    taken = min(abs(float(np.sum(law.added[0]) * PERIOD) / 0.9 - 1.0) for law in behind)
    assert taken < 0.1, "some limit takes the impulse of the pushes from the controller's answer"
    assert not [law for law in found(pushes, tau, q) if law.name != "uneven_friction"]


def test_a_drive_of_limited_rate_passes_for_a_delay_and_pushes() -> None:
    command = 1.5 * np.sign(np.sin(2 * np.pi * 0.7 * TIMES)) + 0.8 * np.sin(2 * np.pi * 2.3 * TIMES)
    tau = slewed(TIMES, command, np.array([12.0]))[0]
    log = simulate(PENDULUM, TIMES, tau[:, None], encoder=False)
    late = {"effect": "actuator_delay", "joint": 1, "probability": 0.9, "equivalents": []}
    late |= {"parameters": {"delay": {"value": 0.01}}}
    causes = [late, pushed(1.0, 0.1)]
    (law,) = found(causes, command, log.q[:, 0])
    assert (law.name, law.throughout) == ("torque_rate_limit", True)
    assert law.factor < 0.1
    rate = float(law.why.split("at most ")[1].split()[0])
    assert rate == pytest.approx(12.0, rel=0.13), "the rates that are tried are a quarter apart"
    apart = {effect for effect, _, _ in withheld({"causes": causes}, [law])}
    assert apart == {"actuator_delay", "actuator_lag", "external_pulse"}
    # Where the drive delivers what it is commanded there is no such law.
    assert found(causes, tau, log.q[:, 0]) == []


def test_pushes_that_all_act_against_the_motion_may_be_friction() -> None:
    q = np.sin(2 * np.pi * 0.25 * TIMES)
    tau = 0.1 * np.cos(2 * np.pi * 0.4 * TIMES)
    # The joint moves up around t = 0, 4 and 8 s, and down around 2 and 6 s.
    times = (0.4, 2.0, 3.7, 4.2, 6.1, 7.6)
    signs = (-1, 1, -1, -1, 1, -1)
    pushes = [pushed(t, 0.2 * sign) for t, sign in zip(times, signs, strict=True)]
    (law,) = found(pushes, tau, q)
    assert (law.name, law.factor) == ("uneven_friction", 8.0 / 2**6)
    assert found(pushes[:3], tau, q) == [], "three are no evidence"
    assert found([pushed(t, 0.2) for t in times], tau, q) == [], "in either direction"
    sizes = (0.2, 0.28, 0.23, 0.17, 0.25, 0.21)
    resisting = [pushed(t, size * sign) for t, size, sign in zip(times, sizes, signs, strict=True)]
    assert found(resisting, tau, q) == [], "somebody who holds against the motion"
    assert [entry[0] for entry in withheld({"causes": pushes}, [law])] == ["external_pulse"]
    data = {"causes": pushes[:4]}
    (law,) = found(pushes[:4], tau, q)
    doubt(data, [law])
    assert [c["probability"] for c in data["causes"]] == pytest.approx(4 * [0.9 * 0.5])
    strong = [pushed(0.4, -0.2, probability=0.4), *pushes[1:4]]
    for push in strong[1:]:
        push["probability"] = 0.9
    (law,) = found(strong, tau, q)
    assert withheld({"causes": strong}, [law]) == [], "the most probable push keeps 0.45"
    for push in pushes[:4]:
        push["probability"] *= 0.5
    assert times_of_pushes(data["causes"]).endswith(
        "Those on joint 1 look like uneven friction: repeat the motion, and it comes back."
    )
    assert "repeat the motion" not in times_of_pushes([pushed(1.0, -0.2)])


def test_a_law_in_place_of_pushes_is_said_and_is_no_matter_of_values() -> None:
    apart = [("external_pulse", 1, "a drive does the same"), ("actuator_lag", 1, "a drive does the same")]
    data: dict[str, Any] = {"causes": [], "candidates": [pushed(1.0, 0.2)], "verdict": "parameters", "notes": ["given"]}
    say_withheld(data, apart)
    assert data["notes"] == ["given", "no push, lag or delay of joint 1 is named: a drive does the same"]
    assert data["verdict"] == "unexplained"
    other: dict[str, Any] = {"causes": [], "candidates": [], "verdict": "parameters", "notes": []}
    say_withheld(other, apart)
    assert (other["notes"], other["verdict"]) == ([], "parameters"), "nothing was found to be withheld"
