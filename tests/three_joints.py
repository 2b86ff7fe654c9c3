"""An arm of three joints as a URDF description, as arm files, and a log of it."""

from __future__ import annotations

import numpy as np
import polars as pl

URDF = """\
<?xml version="1.0"?>
<robot name="three" xmlns:drake="http://drake.mit.edu">
  <link name="base"><inertial><mass value="50"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="column"/><origin xyz="0 0 0.3"/><axis xyz="0 0 2"/>
    <limit lower="0" upper="0.5" velocity="0.2" effort="900"/><dynamics damping="20" friction="8"/></joint>
  <link name="column"><inertial><origin xyz="0 0 0.1"/><mass value="6"/><inertia ixx="0.2" iyy="0.2" izz="0.05"/></inertial></link>
  <joint name="shoulder" type="continuous"><parent link="column"/><child link="upper"/><origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/>
    <axis xyz="0 1 0"/><limit velocity="3" effort="90"/><dynamics damping="0.5" friction="1.5"/></joint>
  <link name="upper"><inertial><origin xyz="0.01 0 0.2" rpy="0.3 0 0.1"/><mass value="3"/>
    <inertia ixx="0.03" ixy="0.001" ixz="0.002" iyy="0.04" iyz="0" izz="0.02"/></inertial></link>
  <joint name="wrist" type="fixed"><parent link="upper"/><child link="mount"/><origin xyz="0 0 0.4" rpy="0 1.2 0"/></joint>
  <link name="mount"/>
  <joint name="elbow" type="revolute"><parent link="mount"/><child link="fore"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="4" effort="40"/><dynamics damping="0.2" friction="0.7"/></joint>
  <link name="fore"><inertial><origin xyz="0 0 0.1"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.002"/></inertial></link>
  <joint name="flange_joint" type="fixed"><parent link="fore"/><child link="flange"/><origin xyz="0 0 0.25"/></joint>
  <link name="flange"/>
  <joint name="finger" type="prismatic"><parent link="flange"/><child link="jaw"/><axis xyz="1 0 0"/>
    <limit lower="0.01" upper="0.04" velocity="1" effort="10"/></joint>
  <link name="jaw"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial></link>
  <joint name="thumb" type="prismatic"><parent link="flange"/><child link="pad"/><axis xyz="1 0 0"/><mimic joint="finger" multiplier="-1"/>
    <limit lower="-0.04" upper="-0.01" velocity="1" effort="10"/></joint>
  <link name="pad"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial></link>
  <drake:collision_filter_group name="g"><drake:member link="fore"/></drake:collision_filter_group>
  <vendor:thing anything="goes"/>
</robot>
"""
ARM = """\
name = "three"
kind = "serial"
urdf = "three.urdf"
tip = "flange"
sample_period = 0.002
[friction]
coulomb = [8.0, 1.5, 0.7]
"""
LINKS = """\
kind = "serial"
sample_period = 0.002
[[link]]
joint = "one"
axis = [0, 1, 0]
mass = 2.0
com = [0, 0, 0.2]
inertia = {ixx = 0.03, iyy = 0.03, izz = 0.01}
[[link]]
joint = "two"
placement = {xyz = [0, 0, 0.4], rpy = [0, 0.1, 0]}
mass = 1.0
"""
JOINTS = ("lift", "shoulder", "elbow")


def motion(samples: int = 400) -> pl.DataFrame:
    """Return a motion of the three joints as a table, with positions, velocities and torques in columns named after the joints."""
    t = np.arange(samples) * 0.002
    data = {"t": t}
    for j, joint in enumerate(JOINTS):
        data[f"{joint}/position"] = 0.2 * (j + 1) * np.sin((5 + j) * t)
        data[f"{joint}/velocity"] = 0.2 * (j + 1) * (5 + j) * np.cos((5 + j) * t)
        data[f"{joint}/effort"] = (j + 1) * np.cos(7 * t)
    return pl.DataFrame(data)


def refused(answer: tuple[int, str, str], says: tuple[str, ...]) -> None:
    """Assert that a command wrote nothing but one line of error, which contains the texts `says` and an advice."""
    status, out, err = answer
    assert (status, out, err.count("\n")) == (2, "", 1), err
    for words in says:
        assert words in err
    assert err.count(";") >= 1  # the advice follows a semicolon
