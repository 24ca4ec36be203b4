"""LineMap: the map that a mapper builds, line segments grouped into unions (section 3.1)."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int, normal_lines, read_only, sealed
from lrf3d.input import read_text
from lrf3d.output import write_text
from lrf3d.words import counted


@dataclass(frozen=True, eq=False)
class LineMap:
    """Line segments of a map; each belongs to a union, which stands for an object.

    Args:
        segments: (m, 4) rows x1 y1 x2 y2 [m] in the world.
        objects: (m,) the union of each segment, numbered from 0.
        points: (m,) number of reflection points that each segment was fitted to.

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

    def __post_init__(self) -> None:
        segments = read_only(self.segments, "segments")
        objects = read_only(self.objects, "objects", np.int64)
        points = read_only(self.points, "points", np.int64)
        if not (
            segments.shape == (len(segments), 4)
            and objects.shape == points.shape == segments.shape[:1]
        ):
            raise InputError(
                f"map of segments {segments.shape}, objects {objects.shape} and points"
                f" {points.shape}: expected shapes (m, 4), (m,) and (m,)"
            )
        if not np.isfinite(segments).all():
            row = int(np.flatnonzero(~np.isfinite(segments).all(axis=1))[0])
            raise InputError(
                f"map: segment {row} is {segments[row].tolist()}, expected finite numbers"
            )
        self.__dict__.update(segments=segments, objects=objects, points=points)

    @classmethod
    def deferred(cls, build: Callable[[], tuple[Float, Int, Int]]) -> "LineMap":
        """A map whose segments, objects and points are made when one of them is asked for."""
        line_map = cls.__new__(cls)
        line_map.__dict__["_build"] = build
        return line_map

    def __getattr__(self, name: str) -> Any:
        # Only what a deferred map was not asked for before is missing.
        if name not in ("segments", "objects", "points") or "_build" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        made = zip(("segments", "objects", "points"), self._build(), strict=True)
        self.__dict__.update({of: read_only(column, of, column.dtype) for of, column in made})
        # Only now: a map whose building was interrupted can be asked again.
        self.__dict__.pop("_build", None)
        return self.__dict__[name]

    def __reduce__(self) -> tuple[Any, ...]:
        return LineMap, (self.segments, self.objects, self.points)

    @classmethod
    def empty(cls) -> "LineMap":
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
        """How many unions there are."""
        return len(np.unique(self.objects))

    @property
    def counts(self) -> str:
        """How many segments and objects there are, in words."""
        return f"{counted(len(self), 'segment')} in {counted(self.object_count, 'object')}"


def save_map(line_map: LineMap, path: str | Path) -> None:
    """Write a map as GeoJSON: a FeatureCollection of one LineString a segment.

    Each has the properties object, alpha [rad], p [m] and points.

    Raises:
        OutputError: The file cannot be written.

    Examples:
        >>> import lrf3d
        >>> lrf3d.save_map(lrf3d.LineMap.empty(), "map.geojson")
        >>> len(lrf3d.load_map("map.geojson"))
        0
    """
    features = [
        {
            "type": "Feature",
            "properties": {
                "object": int(number),
                "alpha": float(alpha),
                "p": float(p),
                "points": int(points),
            },
            "geometry": {
                "type": "LineString",
                "coordinates": [[float(x1), float(y1)], [float(x2), float(y2)]],
            },
        }
        for (x1, y1, x2, y2), (alpha, p), number, points in zip(
            line_map.segments, line_map.lines, line_map.objects, line_map.points, strict=True
        )
    ]
    lines = ",\n".join(json.dumps(feature) for feature in features)
    write_text(path, f'{{"type": "FeatureCollection", "features": [\n{lines}\n]}}\n')


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
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise InputError(f"{path}: not a map of lrf3d ({error!r})") from None
    return LineMap(segments, objects, points)
