"""The map of a run as ROS 2 messages: a grid of cells, and lines that grow with the map."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.geometry import Float
from lrf3d.io.ros_messages import MAP, Messages
from lrf3d.laser import Stamp
from lrf3d.mapping import LineMap
from lrf3d.run import Run
from lrf3d.scene.look import object_tints
from lrf3d.world import World
from lrf3d.world.ros_map import FREE, OCCUPIED, cell_size, map_cells

MAP_TOPIC, OBJECTS_TOPIC = "/map", "/map_objects"
"""The topics of the finished map as cells, and of the map as it grows as lines."""

LINE_WIDTH = 0.1
"""Width of the lines of the map [m]: to be seen from above a room."""

_LINE_LIST, _ADD = 5, 0
"""Numbers of visualization_msgs/Marker: lines between pairs of points; add or replace."""


class MapMessages:
    """The messages of a run's map; none where the run has none.

    Args:
        messages: Makes them.
        run: The run.
        path: The bag, which errors name.
    """

    def __init__(self, messages: Messages, run: Run, path: Path) -> None:
        self._make, self._messages = messages.make, messages
        self._run, self._path = run, path
        self._snapshots = dict(zip(run.snapshot_scans, range(len(run.maps)), strict=True))
        grid = (MAP_TOPIC, "nav_msgs/msg/OccupancyGrid")
        lines = (OBJECTS_TOPIC, "visualization_msgs/msg/MarkerArray")
        self.topics = [grid, lines] if len(run.map) else []

    def finished(self, stamp: Stamp) -> Iterator[Any]:
        """The finished map as a grid: 100 where a wall is, 0 where beams passed, −1 elsewhere."""
        if not self.topics:
            return
        free = self._run.free_cells()
        world = World(self._run.map.segments, free=free)
        size = cell_size(world, free.resolution)
        cells, (x, y) = map_cells(world, size, self._path)
        data = np.full(cells.shape, -1, np.int8)
        data[cells == FREE], data[cells == OCCUPIED] = 0, 100
        rows, columns = cells.shape
        time = self._make("builtin_interfaces/msg/Time", stamp.sec, stamp.nanosec)
        corner = self._pose(x, y)
        info = self._make("nav_msgs/msg/MapMetaData", time, size, columns, rows, corner)
        header = self._messages.header(stamp, MAP)
        yield self._make("nav_msgs/msg/OccupancyGrid", header, info, data.ravel())

    def after(self, scan: int, stamp: Stamp) -> Iterator[Any]:
        """The map after a scan as lines, if it was kept then."""
        if self.topics and scan in self._snapshots:
            number = self._snapshots[scan]
            tints = object_tints(self._run.lasting_objects[number])
            yield self._lines(self._run.maps[number], tints, stamp)

    def _lines(self, line_map: LineMap, tints: Float, stamp: Stamp) -> Any:
        """A map's segments (m, 4) in their colours (m, 3)."""
        make = self._make
        ends = line_map.segments.reshape(-1, 2).tolist()
        points = [make("geometry_msgs/msg/Point", x, y, 0.0) for x, y in ends]
        colours = [
            make("std_msgs/msg/ColorRGBA", *tint, 1.0) for tint in np.repeat(tints, 2, 0).tolist()
        ]
        empty = np.zeros(0, np.uint8)
        no_image = make(
            "sensor_msgs/msg/CompressedImage", self._messages.header(stamp, ""), "", empty
        )
        marker = make(
            "visualization_msgs/msg/Marker",
            self._messages.header(stamp, MAP),
            "map",
            0,
            _LINE_LIST,
            _ADD,
            self._pose(0.0, 0.0),
            make("geometry_msgs/msg/Vector3", LINE_WIDTH, 0.0, 0.0),
            make("std_msgs/msg/ColorRGBA", 0.0, 0.0, 0.0, 1.0),
            make("builtin_interfaces/msg/Duration", 0, 0),
            False,
            points,
            colours,
            "",
            no_image,
            [],
            "",
            "",
            make("visualization_msgs/msg/MeshFile", "", empty),
            False,
        )
        return make("visualization_msgs/msg/MarkerArray", [marker])

    def _pose(self, x: float, y: float) -> Any:
        place = self._make("geometry_msgs/msg/Point", x, y, 0.0)
        return self._make("geometry_msgs/msg/Pose", place, self._messages.turn(0.0))
