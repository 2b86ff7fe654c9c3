"""ROS messages as columns: joint states, commands as arrays of numbers, and joint trajectories.

Every topic is a clock. The stamp in a message's header is its time; messages without stamp have the recorder's time. Columns are
named ``/topic/joint/position`` (``velocity``, ``effort``), columns of arrays without names ``/topic/1`` and so on.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from armgap.errors import ColumnError, LogReadError
from armgap.log.findings import Finding, counted
from armgap.log.recording import Recording, Stream, Suggestion
from armgap.progress import report_progress

__all__ = ["KINDS", "Message", "record"]

_QUANTITIES = ("position", "velocity", "effort")
_PROGRESS_MESSAGES = 5000  # messages between two reports of progress
_TORQUE_WORDS = ("effort", "torque", "tau")
# Rows of a message: time in ns (None without a stamp), names of columns, names of joints, values.
Rows = list[tuple[int | None, tuple[str, ...], tuple[str, ...], list[float]]]


@dataclass(frozen=True)
class Message:
    """One decoded ROS message: topic, type, the recorder's time [ns], and the decoded fields."""

    topic: str
    kind: str
    recorded: int
    content: Any


@dataclass
class _Topic:
    """Rows of one ROS topic whose messages have equal joint names."""

    topic: str
    kind: str
    names: tuple[str, ...]  # names of the columns
    joints: tuple[str, ...]  # names of the joints, where messages state them
    stamps: list[int | None] = field(default_factory=list)
    recorded: list[int] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)

    @property
    def stamped(self) -> bool:
        """Whether every message of the topic has a time stamp."""
        return all(self.stamps)

    @property
    def times(self) -> NDArray[np.int64]:
        """Times of the topic's rows [ns]: message stamps, or the recorder's times for all rows if a stamp is missing."""
        return np.array(self.stamps if self.stamped else self.recorded, dtype=np.int64)


def _stamp(header: Any) -> int:
    """Return the time stamp of a ROS message header [ns]; 0 without a stamp. Field names differ between ROS 1 and 2."""
    stamp = header.stamp
    return int(getattr(stamp, "sec", 0)) * 1_000_000_000 + int(
        getattr(stamp, "nanosec", getattr(stamp, "nanosecond", 0))
    )


def _numbers(values: Iterable[Any]) -> list[float]:
    return [float(v) for v in values]


def _joint_state(message: Message) -> Rows:
    content = message.content
    joints = tuple(str(name) for name in content.name)
    names, row = [], []
    for quantity in _QUANTITIES:
        values = _numbers(getattr(content, quantity))
        if not values:
            continue
        if len(values) != len(joints):
            raise ValueError(f"a message has {len(values)} values of {quantity} for {len(joints)} joints")
        names += [f"{joint}/{quantity}" for joint in joints]
        row += values
    return [(_stamp(content.header), tuple(names), joints, row)]


def _array(message: Message) -> Rows:
    values = _numbers(message.content.data)
    return [(None, tuple(str(i + 1) for i in range(len(values))), (), values)]


def _trajectory(message: Message) -> Rows:
    content = message.content
    joints = tuple(str(name) for name in content.joint_names)
    start = _stamp(content.header) or message.recorded
    rows: Rows = []
    for point in content.points:
        effort = _numbers(point.effort)
        if len(effort) != len(joints):
            continue  # a trajectory point without torques commands positions
        after = int(point.time_from_start.sec) * 1_000_000_000 + int(point.time_from_start.nanosec)
        rows.append((start + after, tuple(f"{joint}/effort" for joint in joints), joints, effort))
    return rows


KINDS: Mapping[str, Callable[[Message], Rows]] = {
    "sensor_msgs/msg/JointState": _joint_state,
    "std_msgs/msg/Float64MultiArray": _array,
    "std_msgs/msg/Float32MultiArray": _array,
    "trajectory_msgs/msg/JointTrajectory": _trajectory,
}
"""Functions that convert a ROS message to rows of a table, by type of message."""


def record(messages: Iterable[Message], path: Path, seen: Mapping[str, str], count: int = 0) -> Recording:
    """Return ROS messages as a recording.

    Parameters
    ----------
    messages : iterable of Message
        Messages of the types in `KINDS`.
    path : Path
        File, for error messages.
    seen : mapping
        Types of all topics of the file, for error messages.
    count : int, default 0
        Number of messages that the file states, over all topics; 0 if unknown.
    """
    topics: dict[tuple[str, tuple[str, ...]], _Topic] = {}
    empty: dict[str, int] = {}
    for number, message in enumerate(messages, start=1):
        if count and number % _PROGRESS_MESSAGES == 0:
            report_progress(f"reading {path.name}", min(number / count, 1.0))
        try:
            rows = KINDS[message.kind](message)
        except (ValueError, TypeError, AttributeError, OverflowError) as error:
            raise LogReadError(
                f"topic {message.topic}, message {number}: {error}",
                remedy="record it again, or cut it there",
                file=path,
            ) from None
        for stamp, names, joints, values in rows:
            if not names:
                empty[message.topic] = empty.get(message.topic, 0) + 1
                continue
            topic = topics.setdefault((message.topic, names), _Topic(message.topic, message.kind, names, joints))
            topic.stamps.append(stamp)
            topic.recorded.append(message.recorded)
            topic.rows.append(values)
    if not topics:
        listed = ", ".join(f"{topic} ({kind})" for topic, kind in list(seen.items())[:12])
        raise LogReadError(
            f"holds no joint states or commands; its topics: {listed or 'none'}",
            remedy=f"record topics of the types {', '.join(KINDS)}",
            file=path,
        )
    findings = [
        Finding("cleaned", f"{topic}: left out {counted(count, 'message')} without values")
        for topic, count in empty.items()
    ]
    return _recording(list(topics.values()), findings, path)


def _recording(topics: list[_Topic], findings: list[Finding], path: Path) -> Recording:
    streams = []
    shared = [t.topic for t in topics]
    for i, topic in enumerate(topics):
        name = topic.topic if shared.count(topic.topic) == 1 else f"{topic.topic}#{i + 1}"
        streams.append(_stream(topic, name, findings))
    findings += _lags(topics)
    known = list(zip(topics, streams, strict=True))
    return Recording(tuple(streams), tuple(findings), lambda n, mapped: _suggest(known, n, mapped, path))


def _stream(topic: _Topic, name: str, findings: list[Finding]) -> Stream:
    """Return a topic's rows sorted by time, without repeated rows, as a stream; findings report the repeats."""
    times, values = topic.times, np.array(topic.rows, dtype=np.float64)
    if not topic.stamped:
        findings.append(Finding("clock", f"{name} carries no time of its own; it goes by the recorder's time"))
    order = np.argsort(times, kind="stable")
    late = int(np.sum(np.diff(times) < 0))
    if late:
        findings.append(Finding("cleaned", f"{name}: {counted(late, 'message')} came late; all were sorted by time"))
        times, values = times[order], values[order]
    again = np.r_[False, (np.diff(times) == 0) & np.all(values[1:] == values[:-1], axis=1)]
    if again.any():
        findings.append(
            Finding("cleaned", f"{name}: left out {counted(int(again.sum()), 'message')} like the one before")
        )
        times, values = times[~again], values[~again]
    return _columns(name, topic, times, values)


def _lags(topics: list[_Topic]) -> list[Finding]:
    """Return findings on how far the recorder's time lags the message stamps, for topics with both."""
    if all(topic.stamped for topic in topics):
        return []
    return [
        Finding("clock", f"{topic.topic} was recorded {lag * 1e-6:.3g} ms after its stamps (median); not corrected")
        for topic in topics
        if topic.stamped and (lag := float(np.median(np.array(topic.recorded) - topic.times))) != 0
    ]


def _columns(name: str, topic: _Topic, times: NDArray[np.int64], values: NDArray[np.float64]) -> Stream:
    data: dict[str, Any] = {f"{name}/stamp": pl.Series(times).cast(pl.Duration("ns"))}
    data |= {f"{name}/{column}": values[:, j] for j, column in enumerate(topic.names)}
    return Stream.of(pl.DataFrame(data), f"{name}/stamp")


def _suggest(known: list[tuple[_Topic, Stream]], n: int | None, mapped: Collection[str], path: Path) -> Suggestion:
    """Suggest columns of joints from the only topic with positions, and of torques from the only topic with commands."""
    names: dict[str, str] = {}
    findings: list[Finding] = []
    if "q1" not in mapped:
        topic, stream = _only([k for k in known if "position" in _held(k)], "positions", "q1", path)
        _check_joints(topic, n, path)
        names |= {f"q{j}": f"{_base(stream)}/{joint}/position" for j, joint in enumerate(topic.joints, start=1)}
        if "velocity" in _held((topic, stream)):
            names |= {f"dq{j}": f"{_base(stream)}/{joint}/velocity" for j, joint in enumerate(topic.joints, start=1)}
        said = ", ".join(f"{j} is {joint}" for j, joint in enumerate(topic.joints, start=1))
        findings.append(Finding("joints", f"joints in the order of {topic.topic}: {said}"))
        n, joints = len(topic.joints), topic.joints
        if "t" not in mapped:
            names["t"] = f"{_base(stream)}/stamp"
        if "tau1" not in mapped:
            torque, said = _torque(known, n, joints, path)
            names |= torque
            findings.append(Finding("torque", said))
    return Suggestion(names, tuple(findings))


def _base(stream: Stream) -> str:
    return str(stream.time).rpartition("/")[0]


def _held(known: tuple[_Topic, Stream]) -> set[str]:
    return {name.rpartition("/")[2] for name in known[0].names}


def _only(fits: list[tuple[_Topic, Stream]], what: str, key: str, path: Path) -> tuple[_Topic, Stream]:
    if len(fits) == 1:
        return fits[0]
    listed = ", ".join(f"`{stream.columns[1]}`" for _, stream in fits[:8])
    raise ColumnError(
        f"there are several topics with {what}: {listed}" if fits else f"no topic holds {what}",
        remedy=f"say which one with --columns {key}=NAME" if fits else "record the joint states",
        file=path,
        column=key,
    )


def _check_joints(topic: _Topic, n: int | None, path: Path) -> None:
    if n is not None and len(topic.joints) != n:
        raise ColumnError(
            f"{topic.topic} holds {len(topic.joints)} joints ({', '.join(topic.joints[:12])}), the arm has {n}",
            remedy=f"say which ones with --columns q1={topic.joints[0]},tau1={topic.joints[0]},…",
            file=path,
            column="q1",
        )


def _torque(
    known: list[tuple[_Topic, Stream]], n: int, joints: tuple[str, ...], path: Path
) -> tuple[dict[str, str], str]:
    """Return the columns of the torques, and a remark: a topic with commands has precedence over the joint states' effort."""
    commands = [k for k in known if _commands(k[0], n, joints)]
    if commands:
        topic, stream = _only(commands, "torque commands", "tau1", path)
        columns = [f"{joint}/effort" for joint in joints] if topic.joints else [str(j) for j in range(1, n + 1)]
        beside = [k[0].topic for k in known if "position" in _held(k) and "effort" in _held(k)]
        more = f"; the effort in {', '.join(beside)} is not used" if beside else ""
        return {f"tau{j}": f"{_base(stream)}/{c}" for j, c in enumerate(columns, start=1)}, (
            f"torques are the commands in {topic.topic}{more}"
        )
    topic, stream = _only([k for k in known if {"position", "effort"} <= _held(k)], "torques", "tau1", path)
    return {f"tau{j}": f"{_base(stream)}/{joint}/effort" for j, joint in enumerate(joints, start=1)}, (
        f"torques are the effort in {topic.topic}, taken as the torque commanded at its stamp"
    )


def _commands(topic: _Topic, n: int, joints: tuple[str, ...]) -> bool:
    """Whether a ROS topic holds torque commands of the given joints."""
    if topic.joints:
        return {name.rpartition("/")[2] for name in topic.names} == {"effort"} and set(joints) <= set(topic.joints)
    return len(topic.names) == n and any(word in topic.topic.lower() for word in _TORQUE_WORDS)
