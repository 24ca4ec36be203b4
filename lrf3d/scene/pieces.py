"""Faces in pieces: cut small for their light, and put together again where it changes evenly.

Light is gathered at the corners of pieces, and between them it is mixed. Quads enter and leave as
rows of corners; what is put together is drawn in less time and looks the same.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lrf3d.geometry import Float, Int, Single


class Pieces(NamedTuple):
    """Pieces of quads, those of one quad one after the other, upwards and then along it.

    Args:
        quads: (m, 4, k) the pieces.
        owners: (m,) which of the quads each is of.
        columns: (m,) into how many pieces along that quad is cut.
        rows: (m,) into how many upwards.
    """

    quads: Single
    owners: Int
    columns: Int
    rows: Int


def cut_small(quads: Single, step: float, most: int) -> Pieces:
    """Cut quads into pieces no wider and higher than a step [m], for light that changes on them.

    Args:
        quads: (n, 4, k) quads whose values change evenly.
        step: The step [m]; longer where there would be too many pieces.
        most: About how many pieces there may be.
    """
    place = quads[:, :, :3].astype(np.float64)
    wide, high = (np.linalg.norm(place[:, corner] - place[:, 0], axis=1) for corner in (1, 3))
    while True:
        counts = (np.ceil(side / step - 1e-3) for side in (wide, high))
        across, up = (np.maximum(1, count).astype(int) for count in counts)
        if int((across * up).sum()) <= max(most, len(quads)):
            break
        step *= 1.4
    found = [Pieces(np.zeros((0, *quads.shape[1:]), np.float32), *np.zeros((3, 0), np.int64))]
    for columns, rows in np.unique(np.column_stack([across, up]), axis=0).tolist():
        chosen = np.flatnonzero((across == columns) & (up == rows))
        quad = quads[chosen].astype(np.float64)
        s = (np.arange(columns + 1) / columns)[:, None, None]
        bottom = quad[:, None, 0] + s.reshape(1, -1, 1) * (quad[:, None, 1] - quad[:, None, 0])
        top = quad[:, None, 3] + s.reshape(1, -1, 1) * (quad[:, None, 2] - quad[:, None, 3])
        t = (np.arange(rows + 1) / rows).reshape(1, 1, -1, 1)
        grid = bottom[:, :, None] + t * (top - bottom)[:, :, None]
        pieces = np.stack(
            [grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]], axis=3
        )
        count = len(chosen) * columns * rows
        found.append(
            Pieces(
                pieces.reshape(-1, *quads.shape[1:]).astype(np.float32),
                np.repeat(chosen, columns * rows),
                np.full(count, columns),
                np.full(count, rows),
            )
        )
    return _chained(found)


def _chained(parts: list[Pieces]) -> Pieces:
    quads, owners, columns, rows = zip(*parts, strict=True)
    return Pieces(
        np.concatenate(quads), np.concatenate(owners), np.concatenate(columns), np.concatenate(rows)
    )


class _Direction(NamedTuple):
    """A direction on a quad: along it or upwards.

    Args:
        starts: The two corners at which a piece starts.
        ends: Those at which it ends, in the same order.
    """

    starts: list[int]
    ends: list[int]


_ALONG, _UP = _Direction([0, 3], [1, 2]), _Direction([0, 1], [3, 2])


def put_together(
    pieces: Pieces, light: list[int], kinds: Int, walls: Int, objects: Int, *, error: float
) -> tuple[Pieces, Int]:
    """Larger pieces where the light of the small ones changes evenly.

    All pieces of a wall are as wide and all of an object as high: a corner in the middle of
    another piece's edge would leave holes a fraction of a pixel wide.

    Args:
        pieces: What :func:`cut_small` made.
        light: Where the light stands in the rows of corners.
        kinds: (m,) what is painted on each: pieces of two kinds stay apart.
        walls: (m,) the wall that each is of.
        objects: (m,) its object.
        error: How far the light of a larger piece may be off that of the small ones.

    Returns:
        The larger pieces, and for each the number of the first of the small ones in it.
    """
    joined, first = _put_together(pieces, _ALONG, light, kinds, walls, error)
    joined, second = _put_together(joined, _UP, light, kinds[first], objects[first], error)
    return joined, first[second]


def _put_together(
    pieces: Pieces, direction: _Direction, light: list[int], kinds: Int, owners: Int, error: float
) -> tuple[Pieces, Int]:
    """Pieces put together in one direction, as many for all of an owner, and the first of each."""
    groups = list(_grids(pieces))
    most = np.ones(int(owners.max(initial=-1)) + 1, dtype=np.int64)
    step, open_to = 1, np.ones(len(most), dtype=bool)
    longest = max((_turned(grid, direction).shape[1] for grid in groups), default=1)
    while step < longest:
        step *= 2
        off = np.zeros(len(most))
        for grid in groups:
            numbers = _turned(grid, direction)
            nodes = _nodes(numbers.shape[1], step, _foot(kinds[numbers]))
            errors = _errors(pieces.quads[..., light], kinds, numbers, nodes, direction)
            np.maximum.at(off, owners[numbers[:, 0, 0]], errors)
        open_to &= off < error
        most[open_to] = step
    found = []
    for grid in groups:
        turned = _turned(grid, direction)
        steps = most[owners[turned[:, 0, 0]]]
        for step in np.unique(steps).tolist():
            numbers = turned[steps == step]
            nodes = _nodes(numbers.shape[1], step, _foot(kinds[numbers]))
            begin, end = numbers[:, nodes[:-1]], numbers[:, nodes[1:] - 1]
            rows = pieces.quads[begin]
            rows[..., direction.ends, :] = pieces.quads[end][..., direction.ends, :]
            if direction is _UP:
                begin, rows = begin.swapaxes(1, 2), rows.swapaxes(1, 2)
            columns, up = begin.shape[1:]
            first = begin.ravel()
            larger = Pieces(
                rows.reshape(len(first), *pieces.quads.shape[1:]),
                pieces.owners[first],
                np.full(len(first), columns),
                np.full(len(first), up),
            )
            found.append((larger, first))
    nothing = Pieces(pieces.quads[:0], *np.zeros((3, 0), np.int64))
    firsts = [np.zeros(0, np.int64), *(first for _, first in found)]
    return _chained([nothing, *(larger for larger, _ in found)]), np.concatenate(firsts)


def _grids(pieces: Pieces) -> Iterator[Int]:
    """Numbers (q, columns, rows) of the pieces of all quads that are cut in the same way."""
    shapes = np.column_stack([pieces.columns, pieces.rows])
    for columns, rows in np.unique(shapes, axis=0).tolist():
        chosen = np.flatnonzero((pieces.columns == columns) & (pieces.rows == rows))
        yield chosen.reshape(-1, columns, rows)


def _turned(grid: Int, direction: _Direction) -> Int:
    """Numbers (q, columns, rows) of pieces with the direction as the second axis."""
    return grid if direction is _ALONG else grid.swapaxes(1, 2)


def _foot(kinds: Int) -> int:
    """1 where the first piece of the second axis (q, n, …) is of its own kind, else 0."""
    return int(bool((kinds[:, :1] != kinds[:, 1:]).any()))


def _nodes(count: int, step: int, first: int) -> Int:
    """Which of the edges between pieces stay, of 0 … count."""
    return np.unique([0, *range(first, count, step), count])


def _errors(light: Single, kinds: Int, numbers: Int, nodes: Int, direction: _Direction) -> Float:
    """How far the light (q,) of quads' pieces (q, n, o) is off that mixed from edges that stay."""
    begin = light[numbers][..., direction.starts, :]
    end = light[numbers[:, -1:]][..., direction.ends, :]
    edges = np.concatenate([begin, end], axis=1).astype(np.float64)
    place = np.arange(edges.shape[1])
    after = np.clip(np.searchsorted(nodes, place, side="right"), 1, len(nodes) - 1)
    low, high = nodes[after - 1], nodes[after]
    share = ((place - low) / (high - low))[:, None, None, None]
    mixed = edges[:, low] + share * (edges[:, high] - edges[:, low])
    off = np.abs(mixed - edges).max(axis=(1, 2, 3, 4), initial=0.0)
    piece = np.searchsorted(nodes, place[:-1], side="right") - 1
    same = kinds[numbers] == kinds[numbers[:, nodes[piece]]]
    return np.where(same.all(axis=(1, 2)), off, np.inf)
