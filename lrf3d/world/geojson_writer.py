"""Writing a world as GeoJSON, so that reading it gives the same world to the last bit.

Walls are written as lines and not as polygons, which a reader would dissolve into blocks.
"""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.output import write_text
from lrf3d.world.colours import colour_value
from lrf3d.world.model import World
from lrf3d.world.pieces import Part, parts_of


def write_geojson(world: World, path: Path) -> None:
    """Write a world as GeoJSON.

    Raises:
        OutputError: The file cannot be written.
    """
    write_text(path, geojson_text(world))


def geojson_text(world: World) -> str:
    """The GeoJSON text of a world: one feature for each run of walls of one object."""
    bare = sorted(set(range(world.object_count)) - set(world.objects.tolist()))
    parts = [*(Part(number, (), np.empty(0)) for number in bare), *parts_of(world)]
    features = ",\n".join(json.dumps(_feature(part, world)) for part in parts)
    # A member of our own, which other readers ignore, as the standard says.
    members = json.dumps([asdict(camera) for camera in world.cameras])
    cameras = f' "cameras": {members},' if world.cameras else ""
    place = "" if world.place is None else f' "place": {json.dumps(world.place)},'
    return (
        f'{{"type": "FeatureCollection", "name": {json.dumps(world.name)}, "units": "m",'
        f'{place}{cameras} "features": [\n{features}\n]}}\n'
    )


def _feature(part: Part, world: World) -> dict[str, Any]:
    properties: dict[str, Any] = {"object": part.number}
    if world.object_names and world.object_names[part.number]:
        properties["name"] = world.object_names[part.number]
    if np.isfinite(world.colours[part.number]).all():
        properties["colour"] = colour_value(world.colours[part.number])
    if not part.pieces:
        return {"type": "Feature", "properties": properties, "geometry": None}
    properties["height"] = part.height_value
    lines = [piece.outline.tolist() for piece in part.pieces]
    geometry = (
        {"type": "LineString", "coordinates": lines[0]}
        if len(lines) == 1
        else {"type": "MultiLineString", "coordinates": lines}
    )
    return {"type": "Feature", "properties": properties, "geometry": geometry}
