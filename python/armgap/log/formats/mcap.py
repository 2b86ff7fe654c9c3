"""MCAP files with ROS 2 messages as logs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from armgap.log.formats import messages
from armgap.log.formats.format import Format, load, reading
from armgap.log.formats.messages import Message
from armgap.log.recording import Recording, Source

__all__ = ["FORMAT"]

_MAGIC = b"\x89MCAP0\r\n"


def read(source: Source) -> Recording:
    """Read an MCAP file as a recording, with its checksums verified."""
    reader = load("mcap.reader", "ros", "MCAP file", source.path)
    decoder = load("mcap_ros2.decoder", "ros", "MCAP file", source.path)
    with reading("MCAP file", source.path), source.open() as stream:
        file = reader.make_reader(stream, validate_crcs=True, decoder_factories=[decoder.DecoderFactory()])
        seen = _topics(file, stream)
        return messages.record(_messages(file, seen), source.path, seen, _count(file, seen))


def _topics(file: Any, stream: Any) -> dict[str, str]:
    """Return the topics of an MCAP file with their types."""
    summary = file.get_summary()
    if summary is not None and summary.channels:
        schemas = summary.schemas
        return {c.topic: schemas[c.schema_id].name if c.schema_id else "" for c in summary.channels.values()}
    stream.seek(0)
    topics = {channel.topic: schema.name if schema else "" for schema, channel, _ in file.iter_messages()}
    stream.seek(0)
    return topics


def _count(file: Any, seen: dict[str, str]) -> int:
    """Return the number of messages to read, as far as the MCAP file states it."""
    summary = file.get_summary()
    if summary is None or summary.statistics is None:
        return 0
    counts = summary.statistics.channel_message_counts
    return sum(counts.get(i, 0) for i, c in summary.channels.items() if seen.get(c.topic) in messages.KINDS)


def _messages(file: Any, seen: dict[str, str]) -> Iterator[Message]:
    wanted = [topic for topic, kind in seen.items() if kind in messages.KINDS]
    if not wanted:
        return
    for schema, channel, message, content in file.iter_decoded_messages(topics=wanted):
        yield Message(channel.topic, schema.name, int(message.log_time), content)


FORMAT = Format("MCAP", (".mcap",), read, lambda head: head.startswith(_MAGIC))
