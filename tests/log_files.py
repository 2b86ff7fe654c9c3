"""One log in every format, written through the formats' own libraries."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from armgap import Log

JOINTS = ("shoulder", "elbow")
START_NS = 1_700_000_000_000_000_000
JOINT_STATE, COMMAND = "/joint_states", "/effort_controller/commands"


def stamps(log: Log) -> np.ndarray:
    """Return the time stamps of a log as nanoseconds since 1970."""
    return START_NS + np.round(log.t * 1e9).astype(np.int64)


def parquet(log: Log, path: Path) -> Path:
    log.write(path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


def csv(log: Log, path: Path) -> Path:
    log.write(path.with_suffix(".csv"))
    return path.with_suffix(".csv")


def npz(log: Log, path: Path) -> Path:
    np.savez(path.with_suffix(".npz"), t=log.t, q=log.q, tau=log.tau)
    return path.with_suffix(".npz")


def hdf5(log: Log, path: Path) -> Path:
    import h5py

    with h5py.File(path.with_suffix(".h5"), "w") as file:
        for name, values in (("run/t", log.t), ("run/q", log.q), ("run/tau", log.tau)):
            file.create_dataset(name, data=values, chunks=True, compression="gzip", fletcher32=True)
    return path.with_suffix(".h5")


def mat5(log: Log, path: Path) -> Path:
    import scipy.io

    scipy.io.savemat(path.with_suffix(".mat"), {"run": {"t": log.t, "q": log.q, "tau": log.tau}})
    return path.with_suffix(".mat")


def mat73(log: Log, path: Path) -> Path:
    """Write a log as MATLAB's version 7.3 lays it out: a text block before the HDF5 file, columns first, classes as attributes."""
    import h5py

    path = path.with_suffix(".mat")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("t", log.t[:, None]), ("q", log.q), ("tau", log.tau)):
            file.create_dataset(name, data=values.T).attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("title", data=np.frombuffer(b"run\0", dtype=np.uint16)).attrs["MATLAB_class"] = np.bytes_(
            "char"
        )
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + bytes([0, 2]) + b"IM")
    return path


MCAP_JOINT_STATE = """\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
MCAP_ARRAY = """\
std_msgs/MultiArrayLayout layout
float64[] data
================================================================================
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
================================================================================
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""


def mcap(log: Log, path: Path, tau: Callable[[int], int | None] | None = None, **options: Any) -> Path:
    """Write a log as MCAP file of joint states with effort; `tau` maps a sample's index to the delay [ns] of an added torque command, or None."""
    from mcap_ros2.writer import Writer

    path = path.with_suffix(".mcap")
    with path.open("wb") as file, Writer(file, **options) as writer:
        state = writer.register_msgdef("sensor_msgs/msg/JointState", MCAP_JOINT_STATE)
        array = writer.register_msgdef("std_msgs/msg/Float64MultiArray", MCAP_ARRAY) if tau else None
        for k, stamp in enumerate(stamps(log)):
            header = {"stamp": {"sec": int(stamp // 10**9), "nanosec": int(stamp % 10**9)}, "frame_id": ""}
            message = {"header": header, "name": list(JOINTS), "position": log.q[k].tolist(), "velocity": []}
            message["effort"] = log.tau[k].tolist()
            writer.write_message(JOINT_STATE, state, message, log_time=int(stamp) + 200_000)
            if tau is not None and (later := tau(k)) is not None:
                command = {"layout": {"dim": [], "data_offset": 0}, "data": log.tau[k].tolist()}
                writer.write_message(COMMAND, array, command, log_time=int(stamp) + later)
    return path


def bag(log: Log, path: Path, storage: str = "sqlite3") -> Path:
    """Write a log as ROS 2 bag with joint states, and the torques as effort commands in joint trajectories."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = SimpleNamespace(**{name.rpartition("/")[2]: kind for name, kind in store.types.items()})
    joint_state, trajectory = "sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory"
    none = np.zeros(0)
    with Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()]) as writer:
        states = writer.add_connection(JOINT_STATE, joint_state, typestore=store)
        commands = writer.add_connection("/commands", trajectory, typestore=store)
        for k, stamp in enumerate(stamps(log)):
            header = types.Header(types.Time(int(stamp // 10**9), int(stamp % 10**9)), "")
            state = types.JointState(header, list(JOINTS), log.q[k].copy(), none, none)
            point = types.JointTrajectoryPoint(none, none, none, log.tau[k].copy(), types.Duration(0, 0))
            command = types.JointTrajectory(header, list(JOINTS), [point])
            writer.write(states, int(stamp), store.serialize_cdr(state, joint_state))
            writer.write(commands, int(stamp), store.serialize_cdr(command, trajectory))
    return path


WRITERS: dict[str, Callable[[Log, Path], Path]] = {
    "Parquet": parquet,
    "CSV": csv,
    "NumPy": npz,
    "HDF5": hdf5,
    "MATLAB 5": mat5,
    "MATLAB 7.3": mat73,
    "MCAP": mcap,
    "ROS 2 bag": bag,
    "ROS 2 bag in MCAP": lambda log, path: bag(log, path, "mcap"),
}
"""Functions that write a log to a path, by format; each returns the path to read."""
