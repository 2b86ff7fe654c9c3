"""Arm files: Table I to theta, defaults, and what is written reads the same."""

from __future__ import annotations

import math

import numpy as np
import pytest

from armgap import Arm
from armgap.errors import ArmFileError, OptionError
from conftest import TABLE_ONE

# Reyes and Kelly (1997), Table II, column "Measured", inertial parameters as printed.
TABLE_TWO = ("2.351", "0.084", "0.102", "38.465", "1.825")

ONE_JOINT = """\
kind = "{kind}"
sample_period = 0.001
[inertial]
theta = {theta}
[friction]
viscous = [0.5]
coulomb = [0.0]
"""


def section_five(m1, m2, l1, c1, c2, i1, i2, g=9.81):
    """Base parameters from physical ones, by the formulas of section 5."""
    return np.array(
        [
            m1 * c1**2 + m2 * l1**2 + m2 * c2**2 + i1 + i2,
            l1 * m2 * c2,
            m2 * c2**2 + i2,
            g * (c1 * m1 + m2 * l1),
            g * m2 * c2,
        ]
    )


TABLE_ONE_VALUES = (23.902, 3.880, 0.45, 0.091, 0.048, 1.266, 0.093)
HALF_A_UNIT = (5e-4, 5e-4, 5e-3, 5e-4, 5e-4, 5e-4, 5e-4)  # of the last printed digit of each


def test_theta_from_table_one(arm):
    np.testing.assert_allclose(arm.theta[:5], section_five(*TABLE_ONE_VALUES), rtol=1e-15)


def test_table_one_gives_table_two(arm):
    """Four to the printed digit, rounded or cut; the fifth within what the rounding of Table I leaves open."""
    for value, printed in list(zip(arm.theta, TABLE_TWO, strict=False))[:4]:
        decimals = len(printed.split(".")[1])
        cut = math.floor(value * 10**decimals) / 10**decimals
        assert printed in (f"{value:.{decimals}f}", f"{cut:.{decimals}f}")
    low = section_five(*(v - h for v, h in zip(TABLE_ONE_VALUES, HALF_A_UNIT, strict=True)))
    high = section_five(*(v + h for v, h in zip(TABLE_ONE_VALUES, HALF_A_UNIT, strict=True)))
    printed = np.array([float(x) for x in TABLE_TWO])
    assert ((low <= printed) & (printed <= high)).all()
    assert abs(arm.theta[4] - 1.825) < 0.0021


def test_friction_follows_the_inertial_parameters(arm):
    np.testing.assert_array_equal(arm.theta[5:], [2.288, 0.175, 7.6095, 1.734])
    assert arm.parameter_names[5:] == ("viscous1", "viscous2", "coulomb1", "coulomb2")
    assert len(arm.parameter_names) == len(arm.parameter_units) == len(arm.theta) == 9


def test_default_trust_is_10_percent_and_50_percent(arm):
    np.testing.assert_allclose(arm.sigma[:5], 0.1 * np.abs(arm.theta[:5]))
    np.testing.assert_allclose(arm.sigma[5:], 0.5 * arm.theta[5:])
    assert (arm.sigma > 0).all()


def test_written_and_read_again(arm, tmp_path):
    path = tmp_path / "again.toml"
    path.write_text(arm.to_toml())
    again = Arm.read(path)
    for name in ("theta", "sigma", "counts_per_rev", "torque_limit", "link_length"):
        np.testing.assert_array_equal(getattr(again, name), getattr(arm, name))
    assert (again.name, again.kind, again.gravity, again.sample_period) == (
        arm.name,
        arm.kind,
        arm.gravity,
        arm.sample_period,
    )


def test_sides_and_gear_ratios(tmp_path):
    path, again = tmp_path / "arm.toml", tmp_path / "again.toml"
    encoder = "[encoder]\ncounts_per_rev = [1024000, 655360]\n"
    assert encoder in TABLE_ONE
    text = TABLE_ONE.replace(encoder, encoder + 'side = ["motor", "unknown"]\n')
    path.write_text(text + '[transmission]\nfriction_side = ["link", "motor"]\ngear_ratio = [1.0, 50.0]\n')
    arm = Arm.read(path)
    assert (arm.encoder_side, arm.friction_side) == (("motor", "unknown"), ("link", "motor"))
    native = arm.to_native()
    assert (native["encoder_at_motor"], native["friction_at_motor"]) == ([True, None], [False, True])
    again.write_text(arm.to_toml())
    second = Arm.read(again)
    assert (second.encoder_side, second.friction_side) == (arm.encoder_side, arm.friction_side)
    assert second.gear_ratio.tolist() == [1.0, 50.0]
    for wrong in ('["motor"]', '["motor", "shaft"]', '"motor"'):
        path.write_text(text + f"[transmission]\nfriction_side = {wrong}\n")
        with pytest.raises(ArmFileError, match=r"transmission.friction_side.*needs a list of 2 of"):
            Arm.read(path)


def test_names_with_quotes_columns_and_seal_survive(tmp_path):
    text = TABLE_ONE.replace("Reyes-Kelly direct-drive arm", 'a \\"b\\" \\\\ c')
    text += f'[columns]\nq1 = "shoulder \\"raw\\""\n[sealed]\nsha256 = "{"ab" * 32}"\n'
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    first.write_text(text)
    arm = Arm.read(first)
    assert (arm.name, arm.columns, arm.sealed) == ('a "b" \\ c', {"q1": 'shoulder "raw"'}, "ab" * 32)
    second.write_text(arm.to_toml())
    again = Arm.read(second)
    assert (again.name, again.columns, again.sealed) == (arm.name, arm.columns, arm.sealed)


@pytest.mark.parametrize(("kind", "theta", "rotary"), [("axis", [12.0, 0.0], False), ("pendulum", [0.3, 4.0], True)])
def test_one_joint(kind, theta, rotary, tmp_path):
    path = tmp_path / "cart.toml"
    path.write_text(ONE_JOINT.format(kind=kind, theta=theta))
    arm = Arm.read(path)
    assert (arm.name, arm.gravity, arm.n_joints, arm.rotary) == ("cart", 9.81, 1, rotary)
    np.testing.assert_array_equal(arm.theta, [*theta, 0.5, 0.0])
    assert (arm.sigma > 0).all()
    assert arm.counts_per_rev is arm.torque_limit is arm.link_length is None


def test_encoder_step(arm):
    np.testing.assert_allclose(arm.encoder_step, [2 * np.pi / 1024000, 2 * np.pi / 655360])


@pytest.mark.parametrize(
    ("theta", "possible"),
    [
        # theta1 + 2 theta2 c, theta3 + theta2 c, theta3: the determinant at c = 1 changes sign between the two.
        ([2.0, 1.0, 0.60, 10.0, 5.0], False),
        ([2.0, 0.4, 0.60, 10.0, 5.0], True),
        ([2.351, 0.084, 0.102, 38.465, 1.825], True),
        ([2.351, 0.084, 2.6, 38.465, 1.825], False),
        ([2.351, 0.084, -0.1, 38.465, 1.825], False),
    ],
)
def test_inertia_matrix_has_to_be_positive_definite(theta, possible, tmp_path):
    path = tmp_path / "arm.toml"
    start, end = TABLE_ONE.index("[links]"), TABLE_ONE.index("[friction]")
    path.write_text(f"{TABLE_ONE[:start]}[inertial]\ntheta = {theta}\n{TABLE_ONE[end:]}")
    if possible:
        np.testing.assert_array_equal(Arm.read(path).theta[:5], theta)
    else:
        with pytest.raises(ArmFileError, match="positive"):
            Arm.read(path)
    c = np.cos(np.linspace(0, np.pi, 721))
    m11, m12, m22 = theta[0] + 2 * theta[1] * c, theta[2] + theta[1] * c, theta[2]
    assert (m22 > 0 and bool((m11 * m22 > m12**2).all())) is possible


def test_the_example_of_the_real_arm(pytestconfig):
    """The makers' physical parameters of design C.1, model 1.0, give the example's theta."""
    arm = Arm.read(pytestconfig.rootpath / "examples" / "dfki-double-pendulum.toml")
    i1, i2, m1, m2, r1, r2, l1, g = 0.0318872, 0.0508698, 0.5234602, 0.6255677, 0.2, 0.2556931, 0.2, 9.81
    theta = [i1 + i2 + m2 * l1**2, m2 * r2 * l1, i2, g * (m1 * r1 + m2 * l1), g * m2 * r2]
    np.testing.assert_allclose(arm.theta[:5], theta, atol=5.1e-5)
    assert arm.columns["tau2"] == "tau_con2"


PENDULUM = {"name": "bench", "kind": "pendulum", "gravity": 9.81, "sample_period": 0.004}


def test_lists_of_numbers_make_an_arm():
    arm = Arm(**PENDULUM, theta=[0.05, 0.6, 0.02, 0.1], sigma=(0.01,) * 4, counts_per_rev=[4096])
    np.testing.assert_array_equal(arm.theta, [0.05, 0.6, 0.02, 0.1])
    assert {x.dtype for x in (arm.theta, arm.sigma, arm.counts_per_rev)} == {np.dtype(np.float64)}
    assert arm.encoder_step.tolist() == [2 * np.pi / 4096]


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"kind": "pendulm"}, "`pendulm` is not a kind of arm; did you mean `pendulum`? (known: axis, pendulum, two-link, serial)"),
        ({"kind": None}, "`None` is not a kind of arm"),
        (
            {"theta": [0.05, 0.6, 0.02]},
            "theta has 3 entries; give 4: theta1 [kg m^2], theta2 [N m], viscous1 [N m s/rad], coulomb1 [N m]",
        ),
        ({"theta": np.ones((2, 4))}, "theta has the shape (2, 4)"),
        ({"theta": [0.05, 0.6, 0.02, math.nan]}, "theta holds nan at entry 4; give finite numbers"),
        ({"theta": [0.05, 0.6, 0.02, "much"]}, "theta is [0.05, 0.6, 0.02, 'much']; give 4: theta1"),
        ({"theta": 0.05}, "theta is 0.05"),
        ({"sigma": [0.1] * 5}, "sigma has 5 entries; give 4: theta1"),
        ({"sigma": None}, "sigma is None"),
        ({"sigma": [0.1, 0.1, -0.1, 0.1]}, "sigma holds -0.1 at entry 3; give numbers from 0"),
        ({"counts_per_rev": [0]}, "counts_per_rev holds 0 at entry 1"),
        ({"torque_limit": [1.0, 2.0]}, "torque_limit has 2 entries; give 1, one per joint"),
        ({"sample_period": 0}, "the arm's sample period is 0"),
    ],
    ids=lambda x: next(iter(x)) if isinstance(x, dict) else "",
)  # fmt: skip
def test_numbers_that_make_no_arm_are_refused(changed, says):
    given = PENDULUM | {"theta": [0.05, 0.6, 0.02, 0.1], "sigma": [0.01] * 4} | changed
    with pytest.raises(OptionError) as caught:
        Arm(**given)
    assert says in str(caught.value)
