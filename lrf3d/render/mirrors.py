"""Mirrors: from where a reflection is seen, and the rectangle through which it is.

The scene is drawn from the mirrored eye before all else; what does not lie past the mirror, seen
through its rectangle, is left out by shaders, and then the rectangle's depth alone closes it.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lrf3d.geometry import LEFT, Float, Single
from lrf3d.scene.shapes import Lens, Seen, single


class Reflection(NamedTuple):
    """What is seen in one mirror."""

    lens: Lens
    """From the mirrored eye."""
    uniforms: dict[str, tuple[float, ...]]
    """The mirror, for shaders: an end and its direction, its length, height and distance [m]."""
    turn: Float
    """(4, 4) the matrix that mirrors places."""
    seal: Single
    """(2, 3, 3) the triangles that close it."""


def reflections(seen: Seen, mirrors: Float) -> Iterator[Reflection]:
    """What is seen in mirrors (m, 5), walls and their heights, that stand in the picture."""
    lens = seen.lens
    nearer = 0.03  # How far before its wall a mirror stands [m].
    for x1, y1, x2, y2, high in mirrors.tolist():
        top, start, along = min(high, seen.cut), np.array([x1, y1]), np.array([x2 - x1, y2 - y1])
        length = float(np.hypot(*along))
        along /= length
        normal = along @ LEFT
        off = float(normal @ (lens.eye[:2] - start))
        foot = start + np.sign(off) * nearer * normal
        ends = np.array([foot, foot + length * along])[[0, 1, 1, 0, 1, 0]]
        corners = np.column_stack([ends, [0.0, 0.0, top, 0.0, top, top]])
        clip = corners @ lens.matrix[:, :3].T + lens.matrix[:, 3]
        sides = clip[:, 3:] + np.hstack([clip[:, :2], -clip[:, :2]])
        if off == 0.0 or (sides < 0.0).all(axis=0).any() or (clip[:, 3] < 0.0).all():
            continue
        turn = np.eye(4)
        turn[:2, :2] -= 2.0 * np.outer(normal, normal)
        turn[:2, 3] = 2.0 * normal * (normal @ start)
        lens_behind = lens._replace(
            matrix=lens.matrix @ turn, eye=lens.eye - 2.0 * off * np.array([*normal, 0.0])
        )
        uniforms = {"mirror": (x1, y1, *along.tolist()), "mirror_size": (length, top, off)}
        yield Reflection(lens_behind, uniforms, turn, single(corners.reshape(2, 3, 3)))
