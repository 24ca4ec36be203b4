"""Worlds from features of maps in metres: footprints of buildings become blocks, lines walls."""

from collections.abc import Sequence

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.geometry import Float, Int
from lrf3d.world.dissolve import STRAIGHT, Block, Footprint, dissolve
from lrf3d.world.geojson_features import Feature
from lrf3d.world.materials import Material
from lrf3d.world.model import DEFAULT_HEIGHT, World
from lrf3d.world.pieces import walls

DEFAULT_BUILDING_HEIGHT = 8.0
"""Default height of a building [m]: two storeys and a roof."""


def world_of_features(
    features: Sequence[Feature],
    name: str,
    *,
    simplify: float = STRAIGHT,
    place: tuple[float, float] | None = None,
) -> World:
    """The world of features: Polygons are dissolved into blocks, lines follow after them.

    Args:
        features: The features of the file.
        name: Name of the world.
        simplify: Largest distance from a straight façade of a corner that is left out [m].
        place: Longitude and latitude [°] of the point (0, 0), if they are known.

    Raises:
        WorldError: No wall remains.
    """
    builder = _Builder()
    owners = [feature for feature in features for _ in feature.polygons]
    footprints = [
        Footprint(rings, feature.height_or(DEFAULT_BUILDING_HEIGHT))
        for feature in features
        for rings in feature.polygons
    ]
    for block in dissolve(footprints, simplify=simplify):
        builder.add_block(block, [owners[index] for index in block.footprints])
    line_features = [feature for feature in features if not feature.polygons]
    numbered = not owners and all(feature.number is not None for feature in line_features)
    for feature in features:
        if feature.lines or (numbered and feature.number is not None):
            builder.add_lines(feature, feature.number if numbered else None)
    return builder.world(name, place)


class _Builder:
    """Collects walls, object by object."""

    def __init__(self) -> None:
        self.segments: list[Float] = []
        self.heights: list[Float] = []
        self.objects: list[Int] = []
        self.names: dict[int, str] = {}
        self.colours: dict[int, tuple[float, float, float]] = {}
        self.materials: dict[int, Material] = {}
        self.next = 0

    def add_block(self, block: Block, owners: list[Feature]) -> None:
        """Add a block, with the name, colour and material of its first footprint that has them."""
        for ring, heights in zip(block.rings, block.heights, strict=True):
            self._add(walls(ring, closed=True), heights, self.next)
        for owner in reversed(owners):
            self._describe(owner, self.next)
        self.next += 1

    def add_lines(self, feature: Feature, number: int | None) -> None:
        """Add the lines of a feature as an object of a number, or of the next one."""
        number = self.next if number is None else number
        segments = [walls(line, closed=False) for line in feature.lines]
        if segments:
            lines = np.concatenate(segments)
            self._add(lines, feature.wall_heights(len(lines), DEFAULT_HEIGHT), number)
        self._describe(feature, number)
        self.next = number + 1

    def _add(self, segments: Float, heights: Float, number: int) -> None:
        self.segments.append(segments)
        self.heights.append(heights)
        self.objects.append(np.full(len(segments), number, dtype=np.int64))

    def _describe(self, feature: Feature, number: int) -> None:
        if feature.name:
            self.names[number] = feature.name
        if feature.colour:
            self.colours[number] = feature.colour
        if feature.material:
            self.materials[number] = feature.material

    def world(self, name: str, place: tuple[float, float] | None) -> World:
        """The world of all walls."""
        if not self.segments:
            raise WorldError("the footprints are too small to leave a wall")
        objects = np.concatenate(self.objects)
        count = int(objects.max()) + 1
        colours = np.full((count, 3), np.nan)
        for number, colour in self.colours.items():
            if number < count:
                colours[number] = colour
        return World(
            np.concatenate(self.segments),
            objects,
            np.concatenate(self.heights),
            name,
            object_names=tuple(self.names.get(number, "") for number in range(count))
            if self.names
            else (),
            colours=colours,
            place=place,
            materials=[self.materials.get(number) for number in range(count)],
        )
