"""Floor plans: walls with a thickness along centre lines, with open doors, and furniture."""

from dataclasses import dataclass, field

import numpy as np

from lrf3d.geometry import Float
from lrf3d.world.model import World
from lrf3d.world.pieces import Part, walls, world_of_parts

THICKNESS = 0.2
"""Thickness of walls [m]."""

DOOR = 2.2
"""Clear width of a door [m]: the planner keeps up to 0.95 m from walls, on a lattice."""

WALL_COLOUR = (0.80, 0.77, 0.71)
"""Warm white of plaster."""


@dataclass
class FloorPlan:
    """Centre lines of walls, and boxes between them.

    Args:
        name: Name of the world.
        height: Height of the walls [m].
    """

    name: str
    height: float = 2.5
    lines: list[tuple[float, float, float, float]] = field(default_factory=list)
    boxes: list[tuple[str, Float, float, tuple[float, float, float]]] = field(default_factory=list)

    def wall(self, x1: float, y1: float, x2: float, y2: float, *doors: float) -> None:
        """Add a wall along an axis, with doors at these distances from its first end [m]."""
        length = abs(x2 - x1) + abs(y2 - y1)
        dx, dy = (x2 - x1) / length, (y2 - y1) / length
        gap = 0.5 * (DOOR + THICKNESS)
        start = 0.0
        for door in sorted(doors):
            self._line(x1, y1, dx, dy, start, door - gap)
            start = door + gap
        self._line(x1, y1, dx, dy, start, length)

    def _line(self, x: float, y: float, dx: float, dy: float, start: float, end: float) -> None:
        if end > start:
            self.lines.append((x + start * dx, y + start * dy, x + end * dx, y + end * dy))

    def outer_walls(self, wide: float, high: float) -> None:
        """Add the outer walls of a plan, without doors, so that a drive stays inside."""
        self.wall(0.0, 0.0, wide, 0.0)
        self.wall(0.0, high, wide, high)
        self.wall(0.0, 0.0, 0.0, high)
        self.wall(wide, 0.0, wide, high)

    def box(
        self, kind: str, corner: Float, size: Float, height: float, colour: tuple[float, ...]
    ) -> None:
        """Add furniture of a size (2,) [m] with its lower left corner (2,) [m]."""
        points = corner + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size
        red, green, blue = colour
        self.boxes.append((kind, points, height, (red, green, blue)))

    def world(self) -> World:
        """The world: walls that touch are one object, and so is each box."""
        import shapely

        half = 0.5 * THICKNESS
        ends = np.array(self.lines)
        areas = shapely.box(
            np.minimum(ends[:, 0], ends[:, 2]) - half,
            np.minimum(ends[:, 1], ends[:, 3]) - half,
            np.maximum(ends[:, 0], ends[:, 2]) + half,
            np.maximum(ends[:, 1], ends[:, 3]) + half,
        )
        # A grid of a millimetre keeps walls that should meet from missing each other by rounding.
        union = shapely.union_all(areas, grid_size=0.001)
        parts = list[Part]()
        for part in shapely.get_parts([shapely.simplify(union, 1e-6)]):
            rings = [np.array(ring.coords)[:-1] for ring in (part.exterior, *part.interiors)]
            outline = np.concatenate([walls(np.round(ring, 3), closed=True) for ring in rings])
            name = f"walls {len(parts)}" if parts else "walls"
            parts.append(Part(len(parts), outline, np.array(self.height), name, WALL_COLOUR))
        for number, (kind, points, height, colour) in enumerate(self.boxes):
            outline = walls(np.round(points, 3), closed=True)
            parts.append(Part(len(parts), outline, np.array(height), f"{kind} {number}", colour))
        return world_of_parts(parts, self.name)
