"""Dynamics of chains against Pinocchio and MuJoCo: random chains of one to seven joints."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from armgap import _native

pinocchio: Any = pytest.importorskip("pinocchio", reason="Pinocchio is missing: pip install pin")
Array = NDArray[np.float64]

#: Rounding of some thousand operations, relative to the largest entry of what is compared.
ROUNDING = 1e-12
#: The same through MuJoCo, which keeps inertias as principal moments and orientations as quaternions.
ROUNDING_MUJOCO = 1e-12
#: States at which every chain is compared.
STATES = 20
#: Step of differences along a motion, s, and their accuracy relative to the largest entry.
STEP, DIFFERENCES = 1e-5, 1e-7


@dataclasses.dataclass(frozen=True)
class Description:
    """A chain by arrays, as `_native.Chain` takes it, with the ten inertial parameters of each link and rotor inertias."""

    kinds: list[str]
    rotation: Array
    translation: Array
    axis: Array
    gravity: Array
    links: Array
    rotors: Array

    @property
    def n(self) -> int:
        return len(self.kinds)

    def chain(self) -> _native.Chain:
        return _native.Chain(self.kinds, self.rotation, self.translation, self.axis, self.gravity)

    def theta(self) -> Array:
        return np.concatenate([self.links.ravel(), self.rotors, np.zeros(2 * self.n)])

    def pinocchio(self) -> Any:
        """The same chain as a model of Pinocchio."""
        model = pinocchio.Model()
        model.gravity.linear = self.gravity
        revolute, prismatic = pinocchio.JointModelRevoluteUnaligned, pinocchio.JointModelPrismaticUnaligned
        for j, kind in enumerate(self.kinds):
            joint = (revolute if kind == "revolute" else prismatic)(self.axis[j])
            placement = pinocchio.SE3(self.rotation[j], self.translation[j])
            number = model.addJoint(j, joint, placement, f"joint{j + 1}")
            inertia = pinocchio.Inertia.FromDynamicParameters(self.links[j])
            model.appendBodyToJoint(number, inertia, pinocchio.SE3.Identity())
        model.armature = self.rotors
        return model

    def mjcf(self) -> str:
        """The same chain as a model of MuJoCo, as text."""
        opened, closed = [], []
        for j, kind in enumerate(self.kinds):
            inertia = pinocchio.Inertia.FromDynamicParameters(self.links[j])
            i = inertia.inertia
            # MuJoCo's body frame is the joint frame.
            quaternion = pinocchio.Quaternion(self.rotation[j]).coeffs()[[3, 0, 1, 2]]
            moments = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
            opened.append(
                f'<body pos="{numbers(self.translation[j])}" quat="{numbers(quaternion)}">'
                f'<inertial pos="{numbers(inertia.lever)}" mass="{inertia.mass:.17g}" fullinertia="{numbers(moments)}"/>'
                f'<joint type="{"hinge" if kind == "revolute" else "slide"}" axis="{numbers(self.axis[j])}"'
                f' armature="{self.rotors[j]:.17g}"/>'
            )
            closed.append("</body>")
        return (
            '<mujoco><compiler angle="radian" balanceinertia="false" boundmass="0" boundinertia="0" inertiafromgeom="false"/>'
            f'<option gravity="{numbers(self.gravity)}"><flag energy="enable"/></option>'
            f"<worldbody>{''.join(opened)}{''.join(closed)}</worldbody></mujoco>"
        )


def numbers(x: Any) -> str:
    return " ".join(f"{float(value):.17g}" for value in x)


def random_rotation(rng: np.random.Generator) -> Array:
    x, y, z, w = unit(rng, 4)
    return np.asarray(pinocchio.Quaternion(w, x, y, z).matrix())


def unit(rng: np.random.Generator, size: int = 3) -> Array:
    x = rng.normal(size=size)
    return np.asarray(x / np.linalg.norm(x))


def random_link(rng: np.random.Generator) -> Array:
    """Ten parameters of a body with a positive density: second moments of mass along its principal axes are positive."""
    mass, along = rng.uniform(0.2, 8), rng.uniform(0.01, 0.2, 3) ** 2
    turn = random_rotation(rng)
    moments = mass * turn @ np.diag(along.sum() - along) @ turn.T
    return np.asarray(pinocchio.Inertia(mass, rng.uniform(-0.3, 0.3, 3), moments).toDynamicParameters())


def random_chain(n: int, seed: int) -> Description:
    rng = np.random.default_rng([n, seed])
    return Description(
        kinds=[str(kind) for kind in rng.choice(["revolute", "revolute", "prismatic"], n)],
        rotation=np.array([random_rotation(rng) for _ in range(n)]),
        translation=rng.uniform(-0.5, 0.5, (n, 3)),
        axis=np.array([unit(rng) for _ in range(n)]),
        gravity=9.81 * unit(rng),
        links=np.array([random_link(rng) for _ in range(n)]),
        rotors=rng.uniform(0, 0.5, n),
    )


def random_states(n: int, seed: int) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng([n, seed, 1])
    return rng.uniform(-3, 3, (STATES, n)), rng.normal(size=(STATES, n)) * 2, rng.normal(size=(STATES, n)) * 5


def agree(found: Array, expected: Array, rounding: float = ROUNDING, least: float = 0.0) -> None:
    """Compare relative to the largest entry, or to `least` where all are small."""
    assert found.shape == expected.shape
    scale = max(np.abs(expected).max(), least)
    assert np.abs(found - expected).max() <= rounding * scale


def configuration(model: Any, q: Array) -> Array:
    """Positions as Pinocchio has them: cosine and sine for joints without limits."""
    parts = [[x] if joint.nq == 1 else [np.cos(x), np.sin(x)] for joint, x in zip(model.joints[1:], q, strict=True)]
    return np.concatenate(parts)


def check_against_pinocchio(description: Description, model: Any, seed: int) -> None:
    n, chain, theta = description.n, description.chain(), description.theta()
    q, dq, ddq = random_states(n, seed)
    data = model.createData()
    at = [configuration(model, row) for row in q]

    def upper(x: Array) -> Array:
        return np.triu(x) + np.triu(x, 1).T

    inertia = np.array([upper(pinocchio.crba(model, data, x)) for x in at])
    bias = np.array([pinocchio.nonLinearEffects(model, data, x, v) for x, v in zip(at, dq, strict=True)])
    states = list(zip(at, dq, ddq, strict=True))
    tau = np.array([pinocchio.rnea(model, data, x, v, a) for x, v, a in states])
    regressor = np.array([pinocchio.computeJointTorqueRegressor(model, data, x, v, a).copy() for x, v, a in states])
    agree(chain.inertia(theta, q), inertia)
    agree(chain.bias(theta, q, dq), bias)
    agree(chain.inverse_dynamics(theta, q, dq, ddq), tau)
    # Pinocchio gives a regressor of one joint without its rows.
    agree(chain.regressor(q, dq, ddq), regressor.reshape(len(q), n, 10 * n))
    partials = [[x.copy() for x in pinocchio.computeRNEADerivatives(model, data, *state)[:2]] for state in states]
    for k, by in enumerate(chain.torque_derivatives(theta, q, dq, ddq)):
        # One joint's torque does not depend on its velocity.
        agree(by, np.array([partial[k] for partial in partials]), least=float(np.abs(tau).max()))
    # Forward dynamics is as exact as the inertia matrix is well conditioned: what counts is the torque of its accelerations.
    accelerations = chain.acceleration(theta, q, dq, tau)
    agree(np.einsum("rij,rj->ri", inertia, accelerations) + bias, tau)

    kinetic = 0.5 * np.einsum("ri,rij,rj->r", dq, inertia, dq)
    rest = pinocchio.computePotentialEnergy(model, data, configuration(model, np.zeros(n)))
    potential = np.array([pinocchio.computePotentialEnergy(model, data, x) for x in at]) - rest
    found = chain.energies(theta, q, dq)
    agree(found[0], kinetic)
    scale = max(np.abs(potential).max(), abs(rest))
    assert np.abs(found[1] - potential).max() <= ROUNDING * scale
    check_relations(description, chain, (q, dq, ddq), inertia)


def check_relations(
    description: Description, chain: _native.Chain, motion: tuple[Array, Array, Array], inertia: Array
) -> None:
    """Momentum, potential part and energy by their regressors, with the inertia matrix of another source."""
    links, (q, dq, ddq), rotors = description.links.ravel(), motion, description.rotors
    momentum = np.einsum("rij,rj->ri", inertia - np.diag(rotors), dq)
    agree(chain.momentum_regressor(q, dq) @ links, momentum)
    kinetic, potential = chain.energies(description.theta(), q, dq)
    energy = kinetic - 0.5 * dq**2 @ rotors + potential
    assert np.abs(chain.energy_regressor(q, dq) @ links - energy).max() <= ROUNDING * np.abs(kinetic).max()
    # Without velocity the rest of the torque is gravity, to which velocities add no more than -dK/dq.
    still = np.zeros_like(q)
    agree(chain.potential_regressor(q, still), chain.regressor(q, still, still))

    def along(step: float) -> tuple[Array, Array]:
        return q + step * dq + 0.5 * step**2 * ddq, dq + step * ddq

    ahead, behind = along(STEP), along(-STEP)
    rate = (chain.momentum_regressor(*ahead) - chain.momentum_regressor(*behind)) / (2 * STEP)
    agree(rate + chain.potential_regressor(q, dq), chain.regressor(q, dq, ddq), DIFFERENCES)
    power = (chain.energy_regressor(*ahead) - chain.energy_regressor(*behind)) / (2 * STEP)
    agree(np.einsum("ri,rij->rj", dq, chain.regressor(q, dq, ddq)), power, DIFFERENCES)


@pytest.mark.parametrize("n", range(1, 8))
@pytest.mark.parametrize("seed", range(5))
def test_random_chains_are_those_of_pinocchio(n, seed):
    description = random_chain(n, seed)
    check_against_pinocchio(description, description.pinocchio(), seed)


@pytest.mark.parametrize("n", range(1, 8))
@pytest.mark.parametrize("seed", range(5))
def test_random_chains_are_those_of_mujoco(n, seed):
    mujoco: Any = pytest.importorskip("mujoco", reason="MuJoCo is missing: pip install 'armgap[trial]'")
    description = random_chain(n, seed)
    model = mujoco.MjModel.from_xml_string(description.mjcf())
    data = mujoco.MjData(model)
    chain, theta = description.chain(), description.theta()
    q, dq, ddq = random_states(n, seed)
    inertia, bias, tau, energy = [], [], [], []
    for state in [(np.zeros(n), np.zeros(n), np.zeros(n)), *zip(q, dq, ddq, strict=True)]:
        data.qpos, data.qvel, data.qacc = state
        mujoco.mj_forward(model, data)
        full = np.zeros((n, n))
        mujoco.mj_fullM(model, data, full)
        inertia.append(full)
        bias.append(data.qfrc_bias.copy())
        energy.append(data.energy.copy())
        data.qacc = state[2]
        mujoco.mj_inverse(model, data)
        tau.append(data.qfrc_inverse.copy())
    agree(chain.inertia(theta, q), np.array(inertia[1:]), ROUNDING_MUJOCO)
    agree(chain.bias(theta, q, dq), np.array(bias[1:]), ROUNDING_MUJOCO)
    agree(chain.inverse_dynamics(theta, q, dq, ddq), np.array(tau[1:]), ROUNDING_MUJOCO)
    kinetic, potential = chain.energies(theta, q, dq)
    agree(kinetic, np.array(energy[1:])[:, 1], ROUNDING_MUJOCO)
    heights = np.array(energy)[:, 0]
    assert np.abs(potential - (heights[1:] - heights[0])).max() <= ROUNDING_MUJOCO * np.abs(heights).max()


def test_names_and_units_of_parameters():
    chain = dataclasses.replace(random_chain(2, 0), kinds=["revolute", "prismatic"]).chain()
    link = ["mass", "mx", "my", "mz", "ixx", "ixy", "iyy", "ixz", "iyz", "izz"]
    names = [f"{stem}{number}" for number in (1, 2) for stem in link]
    names += [f"{stem}{number}" for stem in ("rotor", "viscous", "coulomb") for number in (1, 2)]
    assert chain.parameter_names == names
    units = dict(zip(names, chain.parameter_units, strict=True))
    assert [units[name] for name in ("mass1", "mz2", "ixy1")] == ["kg", "kg m", "kg m^2"]
    assert [units[name] for name in ("rotor1", "viscous1", "coulomb1")] == ["kg m^2", "N m s/rad", "N m"]
    assert [units[name] for name in ("rotor2", "viscous2", "coulomb2")] == ["kg", "N s/m", "N"]


def test_a_free_chain_keeps_its_energy_and_dry_friction_holds_it():
    description = random_chain(6, 3)
    chain, theta = description.chain(), description.theta()
    t = np.arange(401) * 0.0025
    still = np.zeros(6)
    q, dq = chain.simulate(theta, t, np.zeros((401, 6)), still, still, [], 1e-9)
    kinetic, potential = chain.energies(theta, q, dq)
    assert kinetic.max() > 1.0, "it moves"
    assert np.abs(kinetic + potential).max() < 1e-6 * kinetic.max()
    held = theta.copy()
    held[-6:] = 1.01 * np.abs(chain.bias(theta, still[None], still[None])[0])
    q, dq = chain.simulate(held, t, np.zeros((401, 6)), still, still, [])
    assert not q.any()
    assert not dq.any()


def test_a_simulation_with_effects_obeys_their_equations():
    description = random_chain(4, 1)
    chain, theta = description.chain(), description.theta()
    theta[-8:-4] = 0.7
    t, still = np.arange(201) * 0.0025, np.zeros(4)
    rng = np.random.default_rng(0)
    tau = np.repeat(rng.normal(size=(201 // 20 + 1, 4)) * 10, 20, axis=0)[:201]
    effects = [
        ("quadratic_drag", 2, {"c": 0.4}),
        ("torque_offset", 3, {"offset": 1.5}),
        ("rotor_inertia", 4, {"inertia": 0.2}),
    ]
    q, dq = chain.simulate(theta, t, tau, still, still, effects, 1e-10)
    # The motion needs these torques, by inverse dynamics with accelerations of differences within one held torque.
    h = 0.0025
    middle = np.arange(5, 195)
    middle = middle[(middle % 20 > 2) & (middle % 20 < 17)]
    ddq = (dq[middle - 2] - 8 * dq[middle - 1] + 8 * dq[middle + 1] - dq[middle + 2]) / (12 * h)
    needed = chain.inverse_dynamics(theta, q[middle], dq[middle], ddq) + 0.7 * dq[middle]
    needed[:, 1] += 0.4 * np.abs(dq[middle, 1]) * dq[middle, 1]
    needed[:, 2] -= 1.5
    needed[:, 3] += 0.2 * ddq[:, 3]
    assert np.abs(needed - tau[middle]).max() < 1e-5 * np.abs(needed).max()


def test_a_chain_refuses_what_it_is_not():
    description = random_chain(3, 0)

    def other(**changes: Any) -> _native.Chain:
        return dataclasses.replace(description, **changes).chain()

    with pytest.raises(ValueError, match="unknown kind of joint `ball`; known: revolute, prismatic"):
        other(kinds=["revolute", "ball", "revolute"])
    with pytest.raises(ValueError, match=r"`rotation` has shape \[2, 3, 3\], expected \[3, 3, 3\]"):
        other(rotation=description.rotation[:2])
    with pytest.raises(ValueError, match="`rotation` of joint 2 is not a rotation matrix"):
        other(rotation=description.rotation * np.array([1.0, -1.0, 1.0])[:, None, None])
    with pytest.raises(ValueError, match="`axis` of joint 1 has length 2"):
        other(axis=2 * description.axis)
    with pytest.raises(ValueError, match="`gravity` needs 3 finite values"):
        other(gravity=np.array([0.0, np.nan, 0.0]))
    with pytest.raises(ValueError, match="8 joints: a chain has one to 7"):
        random_chain(8, 0).chain()
    with pytest.raises(ValueError, match="0 joints"):
        random_chain(3, 0).__class__([], *(np.zeros(s) for s in ((0, 3, 3), (0, 3), (0, 3), 3, 0, 0))).chain()

    chain, theta, q = description.chain(), description.theta(), np.zeros((5, 3))
    with pytest.raises(ValueError, match="`theta` has 38 values, expected 39"):
        chain.inertia(theta[:-1], q)
    with pytest.raises(ValueError, match=r"`q` has shape \[5, 2\], expected \[5, 3\]"):
        chain.inertia(theta, np.zeros((5, 2)))
    with pytest.raises(ValueError, match=r"`dq` has shape \[4, 3\], expected \[5, 3\]"):
        chain.regressor(q, np.zeros((4, 3)), q)
    simulated = (np.arange(5.0), q, np.zeros(3), np.zeros(3))
    with pytest.raises(ValueError, match="`base_tilt` is of arms that move in one vertical plane"):
        chain.simulate(theta, *simulated, [("base_tilt", None, {"angle": 0.1})])
    with pytest.raises(ValueError, match="`stribeck` needs a joint from 1 to 3"):
        chain.simulate(theta, *simulated, [("stribeck", 4, {"amplitude": 1.0, "velocity": 0.1})])
    with pytest.raises(ValueError, match="`q0` and `dq0` need 3 values"):
        chain.simulate(theta, *simulated[:2], np.zeros(2), np.zeros(3), [])


def test_no_rows_give_no_rows():
    chain, theta, none = random_chain(3, 0).chain(), random_chain(3, 0).theta(), np.zeros((0, 3))
    assert chain.inertia(theta, none).shape == (0, 3, 3)
    assert chain.energy_regressor(none, none).shape == (0, 30)
