"""Collision checks of an arm in a plane: links as capsules, obstacles as boxes, self-collision included."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["FreeSpace"]

Array = NDArray[np.float64]

#: Spacing of the points on a link's axis whose distances to obstacles are computed: the larger of these parts of the link's radius and of its length.
_POINT_SPACING_PER_RADIUS, _POINT_SPACING_PER_LENGTH = 0.5, 1 / 50
#: Part of the last link, from its joint on, that is not checked against the link before it: links touch at the joint they share.
JOINED = 0.5


@dataclass(frozen=True)
class FreeSpace:
    """Shapes of links and obstacles, in the plane of motion: x to the right, y upwards, from the first joint [m].

    Attributes
    ----------
    link_length, link_radius : ndarray, shape (n_joints,)
        Length of every link, and radius of the capsule around its axis [m].
    boxes : ndarray, shape (n_boxes, 4)
        ``x_min, y_min, x_max, y_max`` of each obstacle [m].
    """

    link_length: Array
    link_radius: Array
    boxes: Array

    def clearance(self, q: Array) -> tuple[Array, list[str]]:
        """Return the distances between links and obstacles, and between links, in given poses, with the name of each pair of shapes.

        Distances are taken from points along each link, less half the spacing of the points, so that no obstacle lies between points unseen.

        Parameters
        ----------
        q : ndarray, shape (n_poses, n_joints)
            Positions [rad].

        Returns
        -------
        ndarray, shape (n_poses, n_pairs)
            Distances [m]; negative where shapes overlap.
        list of str
            Pairs, such as ``"link 2 and box 1"``.
        """
        axes = self._axes(q)
        columns, names = [], []
        for k, (points, step) in enumerate(axes):
            for i, box in enumerate(self.boxes):
                away = np.maximum(np.maximum(box[:2] - points, points - box[2:]), 0.0)
                columns.append(np.hypot(away[..., 0], away[..., 1]).min(axis=1) - self.link_radius[k] - 0.5 * step)
                names.append(f"link {k + 1} and box {i + 1}")
        if len(axes) == 2:
            (first, _), (second, step) = axes
            outer = second[:, math.ceil(JOINED * (second.shape[1] - 1)) :]
            columns.append(_to_segment(outer, first[:, -1]).min(axis=1) - self.link_radius.sum() - 0.5 * step)
            names.append("links 1 and 2")
        return np.array(columns).reshape(len(columns), len(q)).T, names

    def is_free(self, q: Array) -> bool:
        """Return whether the arm is free of collision in consecutive poses of a motion and on straight lines in joint space between them.

        Parameters
        ----------
        q : ndarray, shape (n_poses, n_joints)
            Positions [rad].
        """
        reach = np.cumsum(self.link_length[::-1])[::-1]
        way = np.zeros(len(q))
        steps = np.abs(np.diff(q, axis=0)) @ reach
        way[1:] = steps
        way[:-1] = np.maximum(way[:-1], steps)
        return bool(np.all(self.clearance(q)[0] > 0.5 * way[:, None]))

    def touched(self, q: Array) -> str | None:
        """Return the name of a pair of shapes that overlap in a pose `q`, shape (n_joints,); None without overlap."""
        distances, names = self.clearance(q[None])
        if not names:
            return None
        worst = int(np.argmin(distances[0]))
        return names[worst] if distances[0, worst] <= 0 else None

    def _axes(self, q: Array) -> list[tuple[Array, float]]:
        """Return points along the axis of every link, shape (n_poses, n_points, 2), each with the spacing of the points [m]."""
        begin, found = np.zeros((len(q), 2)), []
        for length, radius, angle in zip(self.link_length, self.link_radius, np.cumsum(q, axis=1).T, strict=True):
            count = math.ceil(length / max(_POINT_SPACING_PER_RADIUS * radius, _POINT_SPACING_PER_LENGTH * length)) + 1
            along = np.linspace(0.0, length, count)
            # At position zero a link hangs straight down; angles grow towards +x.
            way = np.stack([np.sin(angle), -np.cos(angle)], axis=1)
            found.append((begin[:, None] + along[:, None] * way[:, None], length / (count - 1)))
            begin = begin + length * way
        return found


def _to_segment(points: Array, end: Array) -> Array:
    """Return the distances of points, shape (n_poses, n_points, 2), from the segments from the origin to `end`, shape (n_poses, 2)."""
    part = np.einsum("pnk,pk->pn", points, end) / np.maximum(np.sum(end * end, axis=1), 1e-300)[:, None]
    nearest = np.clip(part, 0.0, 1.0)[..., None] * end[:, None]
    apart = points - nearest
    return np.asarray(np.hypot(apart[..., 0], apart[..., 1]))
