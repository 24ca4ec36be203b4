"""LineMap: the map that a mapper builds, line segments grouped into unions (section 3.1)."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float, Int, normal_lines
from lrf3d.output import write_text
from lrf3d.words import counted


@dataclass(frozen=True, eq=False)
class LineMap:
    """Line segments of a map; each belongs to a union, which stands for an object.

    Args:
        segments: (m, 4) rows x1 y1 x2 y2 [m] in the world.
        objects: (m,) the union of each segment, numbered from 0.
        points: (m,) number of reflection points that each segment was fitted to.
    """

    segments: Float
    objects: Int
    points: Int

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
        columns = self.__dict__.pop("_build")()
        self.__dict__.update(zip(("segments", "objects", "points"), columns, strict=True))
        return self.__dict__[name]

    def __reduce__(self) -> tuple[Any, ...]:
        return LineMap, (self.segments, self.objects, self.points)

    @classmethod
    def empty(cls) -> "LineMap":
        """The map before the first scan."""
        return cls(np.empty((0, 4)), np.empty(0, np.int64), np.empty(0, np.int64))

    def __len__(self) -> int:
        return len(self.segments)

    @cached_property
    def lines(self) -> Float:
        """Lines (m, 2) of the segments: alpha [rad] in (−π, π], p [m] (Eq. 3)."""
        return normal_lines(self.segments)

    @property
    def object_count(self) -> int:
        """How many unions there are."""
        return len(np.unique(self.objects))

    @property
    def counts(self) -> str:
        """How many segments and objects there are, in words."""
        return f"{counted(len(self), 'segment')} in {counted(self.object_count, 'object')}"

    def save(self, path: str | Path) -> None:
        """Write the map as GeoJSON: a FeatureCollection of one LineString a segment.

        Each has the properties object, alpha [rad], p [m] and points.

        Raises:
            OutputError: The file cannot be written.
        """
        features = [
            {
                "type": "Feature",
                "properties": {
                    "object": int(union),
                    "alpha": float(alpha),
                    "p": float(p),
                    "points": int(points),
                },
                "geometry": {
                    "type": "LineString",
                    "coordinates": [[float(x1), float(y1)], [float(x2), float(y2)]],
                },
            }
            for (x1, y1, x2, y2), (alpha, p), union, points in zip(
                self.segments, self.lines, self.objects, self.points, strict=True
            )
        ]
        lines = ",\n".join(json.dumps(feature) for feature in features)
        write_text(path, f'{{"type": "FeatureCollection", "features": [\n{lines}\n]}}\n')

    @classmethod
    def load(cls, path: str | Path) -> "LineMap":
        """Read a map that :meth:`save` wrote.

        Raises:
            InputError: The file is not such a map.
        """
        try:
            features = json.loads(Path(path).read_text())["features"]
            ends = [feature["geometry"]["coordinates"] for feature in features]
            segments = np.array(ends, dtype=np.float64).reshape(-1, 4)
            values = [feature["properties"] for feature in features]
            objects = np.array([value["object"] for value in values], dtype=np.int64)
            points = np.array([value["points"] for value in values], dtype=np.int64)
        except (OSError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path}: not a map of lrf3d ({error!r})") from None
        return cls(segments, objects, points)
