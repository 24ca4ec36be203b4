"""How long does the scan of a lidar take, and how far is its worst range off single exact beams?

PlanarCaster casts lidars and depth cameras by skylines, bare Embree the same beams one by one, with
its rays prepared beforehand, in turns. All beams of both are compared with those that are cast one
by one in float64 at the triangles of the walls; the tests compare with rational numbers.
"""

from collections.abc import Callable, Sequence
from time import process_time
from typing import Annotated, Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from benchmarks.report import Report
from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.geometry.lines import Float
from lrf3d.laser import DepthCamera, Lidar
from lrf3d.world import World, load_world
from lrf3d.world.mesh import extrude, upright

# [m] A range that is off by more is grossly wrong: lasers err by as much.
GROSS = 0.01

# Places in built-in worlds, x, y [m], theta [rad], in the open.
PLACES = {
    "city": (50.0, 31.0, 0.0),
    "warehouse": (5.0, 5.0, 0.3),
    "glass_office": (3.0, 3.0, 0.3),
    "corridor": (3.0, 3.0, 0.3),
    "paper_room": (1.0, 1.0, 0.2),
    "mirror_hall": (2.0, 2.0, 0.2),
}


def level(layers: int, columns: int, steepest: float) -> Lidar:
    """A lidar of evenly spread layers up to an elevation [°]."""
    return Lidar(np.radians(np.linspace(-steepest, steepest, layers)), columns=columns)


SENSORS: dict[str, tuple[Lidar | DepthCamera, tuple[str, ...]]] = {
    "64 x 1,024": (level(64, 1024, 22.5), tuple(PLACES)),
    "16 x 1,800": (level(16, 1800, 15.0), ("city",)),
    "128 x 2,048": (level(128, 2048, 22.5), ("city",)),
    "depth 640 x 480": (DepthCamera(640, 480, 1.2, range_max=100.0), ("city", "warehouse")),
    "64 x 1,024, tilted": (
        Lidar(np.radians(np.linspace(-22.5, 22.5, 64)), mount=(0, 0, 0.5, 0, 0.087, 0)), ("city",)
    ),
}  # fmt: skip


def scene_of(world: World, floor: float) -> tuple[Callable[[Any, Any], Float], Any]:
    """What casts prepared rays among the walls and the floor around them [m], by bare Embree."""
    low, high = world.bounds
    x0, y0 = low - floor
    x1, y1 = high + floor
    corners = [[[x0, y0, 0], [x1, y0, 0], [x1, y1, 0]], [[x0, y0, 0], [x1, y1, 0], [x0, y1, 0]]]
    halves = upright(world)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3, 3)
    triangles = np.concatenate([halves, np.array(corners, float)]) - [*world.origin, 0.0]
    vertices = np.ascontiguousarray(triangles.reshape(-1, 3), np.float32)
    scene = EmbreeScene()
    kept = TriangleMesh(scene, vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3))
    return lambda origins, ways: scene.run(origins, ways, query="DISTANCE"), (kept, vertices)


def bench(
    *,
    seconds: Annotated[float, "Time for each comparison [s]."] = 2.0,
) -> Report:
    """Time lidars and depth cameras against bare Embree, and count wrong beams of both."""
    report = Report(__doc__.splitlines()[0])
    for name, (sensor, worlds) in SENSORS.items():
        for world in worlds:
            given = load_world(world)
            bare = World(given.segments, given.objects, given.heights, world)
            compare(report, name, sensor, bare, PLACES[world], seconds)
    report.notes.append("wrong: of all beams, off by over 1 cm, or a return where there is none")
    return report


def compare(
    report: Report, name: str, sensor: Lidar | DepthCamera, world: World,
    pose: tuple[float, float, float], seconds: float,
) -> None:  # fmt: skip
    """Add the row of a sensor in a world."""
    caster = PlanarCaster(world)
    cast = caster.cast_lidar if isinstance(sensor, Lidar) else caster.cast_depth
    run, kept = scene_of(world, sensor.range_max)
    beams = sensor.directions(pose).reshape(-1, 3)
    ways = beams.astype(np.float32)
    place = np.array([*pose[:2], sensor.mount[2]])
    origins = np.tile((place - [*world.origin, 0.0]).astype(np.float32), (len(ways), 1))
    ours_s, embree_s = in_turns([lambda: cast(sensor, pose), lambda: run(origins, ways)], seconds)  # type: ignore[arg-type]
    found: Any = cast(sensor, pose)  # type: ignore[arg-type]
    ours = (found.ranges if isinstance(sensor, Lidar) else found.depth).ravel()
    theirs = np.asarray(run(origins, ways), dtype=np.float64)
    theirs[theirs > sensor.range_max] = np.inf
    mesh = extrude(world)
    mesh.apply_translation([*world.origin, 0.0])
    beyond: Any = EmbreeCaster(mesh)
    single = (beyond.cast_lidar if isinstance(sensor, Lidar) else beyond.cast_depth)(sensor, pose)
    true = (single.ranges if isinstance(sensor, Lidar) else single.depth).ravel()
    both = np.isfinite(true) & np.isfinite(ours)
    report.add(
        "lidar",
        sensor=name,
        world=world.name,
        walls=len(world.segments),
        ours_s=ours_s,
        embree_s=embree_s,
        ratio=embree_s / ours_s,
        wrong=int(wrong(ours, true).sum()),
        worst_m=float(np.abs(ours[both] - true[both]).max()),
        embree_wrong=int(wrong(theirs, true).sum()),
    )
    del kept


def in_turns(calls: Sequence[Callable[[], object]], seconds: float) -> list[float]:
    """Medians of the CPU time of calls that take turns [s]: others do not count."""
    spent: list[list[float]] = [[] for _ in calls]
    end = process_time() + seconds
    while len(spent[0]) < 5 or process_time() < end:
        for call, own in zip(calls, spent, strict=True):
            begin = process_time()
            call()
            own.append(process_time() - begin)
    return [float(np.median(own)) for own in spent]


def wrong(ranges: Float, others: Float) -> Any:
    """Which ranges are grossly wrong."""
    there = np.isfinite(ranges)
    both = there & np.isfinite(others)
    away = np.abs(np.where(both, ranges, 0.0) - np.where(both, others, 0.0))
    return (there != np.isfinite(others)) | (away > GROSS)
