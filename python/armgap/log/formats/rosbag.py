"""ROS bags as logs: folders of ROS 2 with SQLite or MCAP files inside, single ``.db3`` files, and ``.bag`` files of ROS 1."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from armgap.log.formats import messages
from armgap.log.formats.format import Format, load, reading
from armgap.log.formats.messages import Message
from armgap.log.recording import Recording, Source

__all__ = ["FORMAT", "is_bag"]

_MAGICS = (b"SQLite format 3\x00", b"#ROSBAG V2.0")


def is_bag(folder: Path) -> bool:
    """Whether a folder is a ROS 2 bag."""
    return (folder / "metadata.yaml").is_file()


def read(source: Source) -> Recording:
    """Read a ROS bag as a recording."""
    highlevel = load("rosbags.highlevel", "ros", "ROS bag", source.path)
    types = load("rosbags.typesys", "ros", "ROS bag", source.path)
    with reading("ROS bag", source.path):
        # Bags of older ROS 2 releases do not carry their messages' definitions.
        store = types.get_typestore(types.Stores.ROS2_HUMBLE)
        with highlevel.AnyReader([source.path], default_typestore=store) as bag:
            seen = {c.topic: c.msgtype for c in bag.connections}
            wanted = [c for c in bag.connections if c.msgtype in messages.KINDS]
            return messages.record(_messages(bag, wanted), source.path, seen, sum(c.msgcount for c in wanted))


def _messages(bag: Any, wanted: list[Any]) -> Iterator[Message]:
    if not wanted:
        return
    for connection, recorded, raw in bag.messages(connections=wanted):
        content = bag.deserialize(raw, connection.msgtype)
        yield Message(connection.topic, connection.msgtype, int(recorded), content)


FORMAT = Format("ROS bag", (".db3", ".bag"), read, lambda head: head.startswith(_MAGICS))
