"""LineMap: the map that a mapper builds, and the file that it is kept in."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lrf3d.base.errors import InputError, expect
from lrf3d.base.files import as_path, read_text, write_text
from lrf3d.base.lazy import Pictured
from lrf3d.base.text import counted
from lrf3d.geometry.lines import (
    LARGEST_COORDINATE,
    Float,
    Int,
    Value,
    lengths,
    normal_lines,
    sealed,
)
from lrf3d.world.free_cells import FreeCells

# What a segment of a map may be.
KINDS = ("wall", "glass", "mirror")
WALL, GLASS, MIRROR = KINDS

# The type of an array of kinds.
KIND = np.dtype("<U6")

# The kind of all segments of a map of walls alone.
WALLS = np.array(WALL, KIND)


@dataclass(frozen=True, eq=False)
class LineMap(Value, Pictured):
    """Line segments of a map, grouped into objects; the paper calls these unions (section 3.1).

    Args:
        segments: (m, 4) rows x1 y1 x2 y2 [m] in the world.
        objects: (m,) the object of each segment, numbered from 0.
        points: (m,) number of reflection points that each segment was fitted to.
        kinds: (m,) what each segment is: ``wall``, ``glass`` or ``mirror``; all are walls if not
            given.

    Raises:
        InputError: The shapes do not fit, a kind is unknown, or a coordinate is not finite or over
            1e9 m.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> segments = np.array([[0.0, 0.0, 4.0, 0.0]])
        >>> line_map = lrf3d.LineMap(segments, objects=np.array([0]), points=np.array([40]))
        >>> len(line_map), line_map.object_count
        (1, 1)
    """

    segments: Float
    objects: Int
    points: Int
    kinds: NDArray[np.str_] = field(default_factory=lambda: WALLS)

    def __post_init__(self) -> None:
        self._hold("segments")
        self._hold("objects", "points", dtype=np.int64)
        segments = self.segments
        shapes = segments.shape, self.objects.shape, self.points.shape
        if not (segments.shape[1:] == (4,) and shapes[1] == shapes[2] == segments.shape[:1]):
            raise InputError(
                f"map of segments {shapes[0]}, objects {shapes[1]} and points {shapes[2]}:"
                " expected shapes (m, 4), (m,) and (m,)"
            )
        kinds = np.array(self.kinds, dtype=KIND)
        if not kinds.ndim:
            kinds = np.full(len(segments), kinds)
        known = (kinds == WALL) | (kinds == GLASS) | (kinds == MIRROR)
        if kinds.shape != self.objects.shape or not known.all():
            raise InputError(
                f"map of {len(segments)} segments with kinds {kinds.tolist()}: expected"
                f" {', '.join(KINDS)}, one for each segment"
            )
        object.__setattr__(self, "kinds", sealed(kinds))
        inside = np.abs(segments) <= LARGEST_COORDINATE
        if not inside.all():
            row = int(np.argmin(inside.all(axis=1)))
            raise InputError(
                f"map: segment {row} is {segments[row].tolist()}, expected numbers of at most"
                f" {LARGEST_COORDINATE:g} m"
            )

    @property
    def codes(self) -> Int:
        """What each segment (m,) is, as its place in KINDS."""
        return np.asarray((self.kinds == GLASS) + 2 * (self.kinds == MIRROR), dtype=np.int64)

    @classmethod
    def of_codes(cls, segments: Float, objects: Int, points: Int, codes: Int) -> LineMap:
        """The map of segments with `codes`."""
        return cls(segments, objects, points, np.array(KINDS, KIND)[codes])

    @classmethod
    def empty(cls) -> LineMap:
        """The map before the first scan."""
        return cls(np.empty((0, 4)), np.empty(0, np.int64), np.empty(0, np.int64))

    def __repr__(self) -> str:
        return f"LineMap({self.counts})"

    def __len__(self) -> int:
        return len(self.segments)

    @cached_property
    def lines(self) -> Float:
        """Lines (m, 2) of the segments: alpha [rad] in (−π, π], p [m] (Eq. 3)."""
        return sealed(normal_lines(self.segments))

    @property
    def object_count(self) -> int:
        """The number of objects."""
        return len(np.unique(self.objects))

    @property
    def counts(self) -> str:
        """The numbers of segments and objects, in words."""
        return f"{counted(len(self), 'segment')} in {counted(self.object_count, 'object')}"


def solid_map(segments: Float, labels: Int, points: Int) -> LineMap:
    """The map of segments (m, 4) whose objects are named by any labels (m,).

    Far from the world's origin the ends of a tiny segment may round to one place; it is left out,
    like what lies beyond the largest coordinate.
    """
    solid = lengths(segments) > 0.0
    inside = np.abs(segments) <= LARGEST_COORDINATE
    if not (solid.all() and inside.all()):
        solid &= inside.all(axis=1)
        segments = segments[solid]
        labels = labels[solid]
        points = points[solid]
    return LineMap(segments, np.unique(labels, return_inverse=True)[1], points)


# The reference system of a map, metres on a plane, without which programs expect degrees.
METRES = {"type": "name", "properties": {"name": 'LOCAL_CS["map",UNIT["metre",1]]'}}


def save_map(line_map: LineMap, path: str | Path, *, free: FreeCells | None = None) -> None:
    """Write a map as GeoJSON: a FeatureCollection of one LineString a segment.

    Each has the properties object, alpha [rad], p [m] and points, and kind if it is no wall.
    :func:`load_world` reads the file as the world that the map shows.

    Args:
        line_map: The map.
        path: The file.
        free: What its scans saw to be free, see :meth:`Run.free_cells`: routes through the world
            are planned there.

    Raises:
        InputError: The file's ending is that of another format.
        OutputError: The file cannot be written.

    Examples:
        >>> import lrf3d
        >>> lrf3d.save_map(lrf3d.LineMap.empty(), "map.geojson")
        >>> len(lrf3d.load_map("map.geojson"))
        0
    """
    expect(line_map, LineMap, "map")
    expect(free, FreeCells | None, "free")
    # Endings of worlds that are written in other formats than a map.
    if as_path(path).suffix.lower() in (".toml", ".yaml", ".yml", ".glb"):
        raise InputError(
            f"{path}: a map is written as .geojson; load_world reads that, and save_world writes"
            " other formats"
        )
    ends = line_map.segments.reshape(-1, 2, 2)
    columns = (*line_map.lines.T, line_map.objects, line_map.points, line_map.kinds, ends)
    features = []
    for alpha, p, number, count, kind, shape in zip(
        *(each.tolist() for each in columns), strict=True
    ):
        named = {"object": number, "alpha": alpha, "p": p, "points": count}
        named |= {} if kind == WALL else {"kind": kind}
        geometry = {"type": "LineString", "coordinates": shape}
        features.append({"type": "Feature", "properties": named, "geometry": geometry})
    lines = ",\n".join(map(json.dumps, features))
    known = "" if free is None else f' "free": {json.dumps(free.as_dict())},'
    head = f'"type": "FeatureCollection", "units": "m", "crs": {json.dumps(METRES)},{known}'
    write_text(path, f'{{{head} "features": [\n{lines}\n]}}\n')


def load_map(path: str | Path) -> LineMap:
    """Read a map that :func:`save_map` wrote.

    Raises:
        InputError: The file is not such a map.

    Examples:
        >>> import lrf3d
        >>> lrf3d.save_map(lrf3d.LineMap.empty(), "map.geojson")
        >>> lrf3d.load_map("map.geojson").segments.shape
        (0, 4)
    """
    try:
        features = json.loads(read_text(path, what="a map of lrf3d"))["features"]
        ends = [feature["geometry"]["coordinates"] for feature in features]
        segments = np.array(ends, dtype=np.float64).reshape(-1, 4)
        values = [feature["properties"] for feature in features]
        objects = np.array([value["object"] for value in values], dtype=np.int64)
        points = np.array([value["points"] for value in values], dtype=np.int64)
        kinds = np.array([value.get("kind", WALL) for value in values], dtype=KIND)
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise InputError(f"{path}: not a map of lrf3d ({error!r})") from None
    try:
        return LineMap(segments, objects, points, kinds)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
