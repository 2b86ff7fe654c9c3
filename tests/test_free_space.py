"""What an arm must not touch: distances beside MuJoCo's, motions that keep them, arm files."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import armgap
from armgap import Arm, plan
from armgap.arm.free_space import JOINED, FreeSpace
from armgap.errors import ArmFileError, OptionError
from armgap.planning import search
from conftest import TABLE_ONE
from test_plan import CONTROLLER, DURATION, LIMITS, slow_log

LENGTHS, RADII = np.array([0.45, 0.3]), np.array([0.06, 0.04])
BOXES = np.array([[0.3, -0.9, 0.8, -0.3], [-0.7, 0.1, -0.2, 0.4]])
GAUGE = 1e-6  # m: what MuJoCo's distances are right to


def mujoco_distances(poses: np.ndarray) -> np.ndarray:
    """Distances of both links to both boxes, and of the outer half of link 2 to link 1, by MuJoCo."""
    mujoco = pytest.importorskip("mujoco")
    boxes = "".join(
        f'<geom name="box{i}" type="box" pos="{(a + c) / 2} {(b + d) / 2} 0" size="{(c - a) / 2} {(d - b) / 2} 1"/>'
        for i, (a, b, c, d) in enumerate(BOXES)
    )
    capsule = '<geom name="{}" type="capsule" fromto="0 {} 0 0 {} 0" size="{}"/>'
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody>{boxes}
        <body><joint axis="0 0 1"/>{capsule.format("link0", 0, -LENGTHS[0], RADII[0])}
          <body pos="0 {-LENGTHS[0]} 0"><joint axis="0 0 1"/>{capsule.format("link1", 0, -LENGTHS[1], RADII[1])}
            {capsule.format("outer", -JOINED * LENGTHS[1], -LENGTHS[1], RADII[1])}
          </body></body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    pairs = [(f"link{k}", f"box{i}") for k in range(2) for i in range(len(BOXES))] + [("outer", "link0")]
    found = []
    for q in poses:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        ids = [[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) for name in pair] for pair in pairs]
        found.append([mujoco.mj_geomDistance(model, data, a, b, 10.0, None) for a, b in ids])
    return np.array(found)


def test_distances_are_those_of_mujoco_but_for_the_step_along_the_links():
    poses = np.random.default_rng(3).uniform(-math.pi, math.pi, (400, 2))
    ours, names = FreeSpace(LENGTHS, RADII, BOXES).clearance(poses)
    theirs = mujoco_distances(poses)
    assert names[-1] == "links 1 and 2"
    apart = theirs > 0
    assert 0.2 < apart.mean() < 0.95
    assert np.all(ours[apart] <= theirs[apart] + GAUGE)
    assert np.all(ours[apart] >= theirs[apart] - RADII.max() / 2 - GAUGE)
    assert np.all(ours[~apart] <= GAUGE)


def test_what_lies_between_two_samples_is_not_missed():
    thin = FreeSpace(LENGTHS, RADII, np.array([[0.0, 0.6, 0.01, 0.7]]))
    sides = np.array([[math.pi - 0.4, 0.0], [math.pi + 0.4, 0.0]])
    assert thin.clearance(sides)[0].min() > 0
    assert not thin.is_free(sides)
    assert thin.is_free(np.repeat(sides[:1], 2, axis=0))


def test_one_link_without_boxes_touches_nothing():
    alone = FreeSpace(LENGTHS[:1], RADII[:1], np.empty((0, 4)))
    poses = np.array([[0.0], [3.0]])
    assert alone.is_free(poses)
    assert alone.touched(poses[0]) is None


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    path = tmp_path_factory.mktemp("walled") / "arm.toml"
    wall = "link_radius = [0.06, 0.04]\nboxes = [[0.35, -0.9, 0.9, 0.0]]\n"
    path.write_text(TABLE_ONE + LIMITS + wall + CONTROLLER)
    arm = Arm.read(path)
    return arm, armgap.diagnose([slow_log(arm)], arm)


@pytest.mark.slow
def test_a_plan_touches_nothing(diagnosed, monkeypatch):
    monkeypatch.setattr(search, "POPULATION", 6)
    monkeypatch.setattr(search, "GENERATIONS", 1)
    arm, diagnosis = diagnosed
    made = plan(diagnosis, arm, questions=["quadratic_drag:1"], duration=DURATION)
    space = arm.limits.space
    assert space.is_free(made.q_ref)
    assert np.ptp(made.q_ref, axis=0).min() > 0.1
    assert made.limits.to_dict()["boxes"] == [[0.35, -0.9, 0.9, 0.0]]
    assert not any("link_radius" in note for note in made.notes)


@pytest.mark.slow
def test_without_shapes_it_is_said(diagnosed, monkeypatch):
    monkeypatch.setattr(search, "POPULATION", 6)
    monkeypatch.setattr(search, "GENERATIONS", 1)
    arm, diagnosis = diagnosed
    bare = replace(arm, limits=replace(arm.limits, space=None))
    made = plan(diagnosis, bare, questions=["quadratic_drag:1"], duration=DURATION)
    assert any("link_radius" in note for note in made.notes)


def test_a_home_in_a_box_is_refused(diagnosed):
    arm, diagnosis = diagnosed
    boxed = FreeSpace(arm.link_length, RADII, np.array([[-0.1, -0.9, 0.1, -0.5]]))
    with pytest.raises(OptionError, match="link 2 and box 1 touch where the motion begins"):
        plan(diagnosis, replace(arm, limits=replace(arm.limits, space=boxed)), duration=DURATION)


def test_shapes_are_written_and_read_again(diagnosed, tmp_path):
    arm, _ = diagnosed
    (tmp_path / "copy.toml").write_text(arm.to_toml())
    again = Arm.read(tmp_path / "copy.toml")
    assert again.to_toml() == arm.to_toml()
    np.testing.assert_array_equal(again.limits.space.boxes, arm.limits.space.boxes)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ("boxes = [[0, 0, 1, 1]]", ("limits.link_radius", "is missing")),
        ("link_radius = [0.1]", ("limits.link_radius", "needs a list of 2")),
        ("link_radius = [0.1, 0]", ("limits.link_radius", "above 0")),
        ("link_radius = [0.1, 0.1]\nboxes = [[0, 0, 1]]", ("limits.boxes", "needs a list of 4")),
        ("link_radius = [0.1, 0.1]\nboxes = [[1, 0, 0, 1]]", ("limits.boxes", "box 1 has no inside")),
        ("link_radius = [0.1, 0.1]\nboxes = 3", ("limits.boxes", "give a list")),
    ],
)
def test_bad_shapes_are_refused_in_one_line(lines, says, tmp_path):
    path = tmp_path / "arm.toml"
    path.write_text(TABLE_ONE + LIMITS + lines + "\n" + CONTROLLER)
    with pytest.raises(ArmFileError) as caught:
        Arm.read(path)
    assert "\n" not in str(caught.value)
    assert all(word in str(caught.value) for word in (*says, "arm.toml"))
