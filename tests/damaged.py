"""Damage to files, as copying and storage may cause it, made by a seeded generator."""

from __future__ import annotations

import random
from collections.abc import Iterator

import numpy as np

from armgap import Log


def small_log(n: int = 40) -> Log:
    """Return a short log of two joints."""
    t = np.arange(n) * 0.0025
    q = np.column_stack([np.sin(9 * t), 0.5 * np.cos(7 * t)])
    tau = np.column_stack([5 * np.cos(9 * t), np.sin(7 * t)])
    return Log.from_arrays(t, q, tau, name="small")


def damaged(data: bytes, count: int, seed: int) -> Iterator[bytes]:
    """Yield copies of a file's bytes that are cut short, or have bytes overwritten, bits flipped, or blocks zeroed, filled, doubled or removed."""
    draw = random.Random(seed)
    ways = (_cut, _overwritten, _flipped, _zeroed, _filled, _doubled, _missing)
    for i in range(count):
        yield ways[i % len(ways)](data, draw)


def _cut(data: bytes, draw: random.Random) -> bytes:
    return data[: draw.randrange(len(data))]


def _overwritten(data: bytes, draw: random.Random) -> bytes:
    worse = bytearray(data)
    for _ in range(draw.choice([1, 2, 4, 16])):
        worse[draw.randrange(len(worse))] = draw.randrange(256)
    return bytes(worse)


def _flipped(data: bytes, draw: random.Random) -> bytes:
    worse = bytearray(data)
    worse[draw.randrange(len(worse))] ^= 1 << draw.randrange(8)
    return bytes(worse)


def _span(data: bytes, draw: random.Random, most: int) -> tuple[int, int]:
    start = draw.randrange(len(data))
    return start, min(len(data), start + draw.randrange(1, most))


def _zeroed(data: bytes, draw: random.Random) -> bytes:
    start, end = _span(data, draw, 200)
    return data[:start] + bytes(end - start) + data[end:]


def _filled(data: bytes, draw: random.Random) -> bytes:
    start, end = _span(data, draw, 10)
    return data[:start] + b"\xff" * (end - start) + data[end:]


def _doubled(data: bytes, draw: random.Random) -> bytes:
    start, end = _span(data, draw, 200)
    return data[:end] + data[start:end] + data[end:]


def _missing(data: bytes, draw: random.Random) -> bytes:
    start, end = _span(data, draw, 200)
    return data[:start] + data[end:]
