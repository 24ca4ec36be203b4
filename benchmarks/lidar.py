"""How long does the scan of a lidar take, and how far is its worst range off single exact beams?

PlanarCaster casts lidars and depth cameras by skylines; bare Embree, and Open3D and MuJoCo where
they are installed, the same beams one by one, with their rays prepared beforehand, in turns. All
beams are compared with those that are cast one by one in float64 at the triangles of the walls.
Then dynamic obstacles, rolling scans, environments, and beams of the hardest kinds by rationals.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import partial
from importlib import import_module
from time import process_time
from typing import Annotated, Any

import numpy as np
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from benchmarks.report import Report
from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.casting.crowd import Crowd
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.casting.skyline import Conditions, Layered, StandingWalls, _columns, rays_along
from lrf3d.geometry.lines import Float
from lrf3d.gym import DriveVectorEnv
from lrf3d.laser import DepthCamera, LaserRangeFinder, Lidar
from lrf3d.robot import Trajectory
from lrf3d.simulation.scenario import load_scenario
from lrf3d.world import World, load_world
from lrf3d.world.generators import generate_city
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
    walls: Annotated[int, "Walls of the large town."] = 100_000,
    robots: Annotated[int, "Robots of the environment."] = 1024,
    beams: Annotated[int, "Beams of the hardest kinds."] = 1_000_000,
    footprints: Annotated[str | None, "A world of buildings with heights, such as GeoJSON."] = None,
) -> Report:
    """Time lidars and depth cameras against bare Embree, and count wrong beams of both."""
    report = Report(__doc__.splitlines()[0])
    for name, (sensor, worlds) in SENSORS.items():
        for world in worlds:
            given = load_world(world)
            bare = World(given.segments, given.objects, given.heights, world)
            compare(report, name, sensor, bare, PLACES[world], seconds)
    large = generate_city(walls)
    compare(report, "64 x 1,024", SENSORS["64 x 1,024"][0], large, PLACES["city"], seconds)
    if footprints is not None:
        town = load_world(footprints)
        place = (*town.bounds.mean(axis=0).tolist(), 0.0)
        compare(report, "128 x 2,048", SENSORS["128 x 2,048"][0], town, place, seconds)
    moving(report, seconds)
    environments(report, robots)
    hardest(report, beams)
    report.notes.append("wrong: of all beams, off by over 1 cm, or a return where there is none")
    report.notes += [f"{name} is not installed" for name in OTHERS if not library(name)]
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
    triangles = kept[1].reshape(-1, 3, 3)
    installed = [name for name in OTHERS if library(name)]
    others = [OTHERS[name](triangles, origins, ways) for name in installed]
    calls = [lambda: cast(sensor, pose), lambda: run(origins, ways), *others]  # type: ignore[arg-type]
    ours_s, *others_s = in_turns(calls, seconds)
    found: Any = cast(sensor, pose)  # type: ignore[arg-type]
    ours = (found.ranges if isinstance(sensor, Lidar) else found.depth).ravel()
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
        wrong=int(wrong(ours, true).sum()),
        worst_m=float(np.abs(ours[both] - true[both]).max()),
        **{
            f"{other}_{what}": figure
            for other, call, spent in zip(["embree", *installed], calls[1:], others_s, strict=True)
            for what, figure in (
                ("ratio", spent / ours_s), ("wrong", int(wrong(within(call(), sensor), true).sum()))
            )
        },
    )  # fmt: skip
    del kept


def within(ranges: Any, sensor: Lidar | DepthCamera) -> Float:
    """Ranges (n,) of others, where those beyond range_max do not return."""
    found = np.asarray(ranges, dtype=np.float64)
    return np.where(found > sensor.range_max, np.inf, found)


def library(name: str) -> Any:
    """A library that may be installed, or None; Open3D also needs libraries of the system."""
    with suppress(ImportError):
        return import_module(name)


def open3d_rays(triangles: Any, origins: Any, ways: Any) -> Callable[[], Any]:
    """What casts rays by Open3D on one core."""
    o3d = library("open3d")
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    tensor = o3d.core.Tensor
    numbers = np.arange(3 * len(triangles), dtype=np.uint32).reshape(-1, 3)
    scene.add_triangles(tensor(triangles.reshape(-1, 3)), tensor(numbers))
    rays = tensor(np.hstack([origins, ways]))
    return lambda: scene.cast_rays(rays, nthreads=1)["t_hit"].numpy()


def mujoco_rays(triangles: Any, origins: Any, ways: Any) -> Callable[[], Any]:
    """What casts rays by MuJoCo, at a mesh."""
    mujoco = library("mujoco")
    spec = mujoco.MjSpec()
    numbers = np.arange(3 * len(triangles), dtype=np.int32)
    shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    vertices = triangles.ravel().astype(np.float64)
    spec.add_mesh(name="walls", uservert=vertices, userface=numbers, inertia=shell)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="walls")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    count = len(ways)
    lengths = np.linalg.norm(ways.astype(np.float64), axis=1)
    beams = (ways / lengths[:, None]).astype(np.float64).ravel()
    place = origins[0].astype(np.float64)
    hits = np.empty(count, np.int32)
    ranges = np.empty(count)

    def cast() -> Any:
        far = mujoco.mjMAXVAL
        mujoco.mj_multiRay(
            model, data, place, beams, None, 1, -1, hits, ranges, None, count, far
        )  # fmt: skip
        return np.where(ranges < 0.0, np.inf, ranges) / lengths

    return cast


# Other programs by the name of their package, each with what casts prepared rays.
OTHERS = {"open3d": open3d_rays, "mujoco": mujoco_rays}


def moving(report: Report, seconds: float) -> None:
    """Time scans among five dynamic obstacles, and rolling ones, against still scans of walls."""
    lidar = level(64, 1024, 22.5)
    caster = PlanarCaster(load_world("city"))
    place = PLACES["city"]
    around = 3.0 * np.column_stack([np.cos(np.arange(5)), np.sin(np.arange(5)), np.zeros(5)])
    square = 0.3 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    path = [Trajectory([0.0], [at + place]) for at in around]
    crowd = Crowd([DynamicObstacle(square, each, 1.7) for each in path])
    rolling = replace(lidar, scan_duration=0.1)
    forward = Conditions(motion=np.array([0.1, 0.0, 0.02]))
    run, _ = scene_of(caster.world, lidar.range_max)
    ways = lidar.directions(place).reshape(-1, 3).astype(np.float32)
    origins = np.tile([*(np.array(place[:2]) - caster.world.origin), 0.5], (len(ways), 1))
    boxes = [
        trimesh.creation.box((0.6, 0.6, 1.7)).apply_translation([*at[:2], 0.35]) for at in around
    ]
    scene = EmbreeScene()
    small: Any = trimesh.util.concatenate(boxes)
    kept = TriangleMesh(scene, small.vertices.astype(np.float32), small.faces.astype(np.int32))
    middle = np.zeros_like(ways)
    still_s, crowd_s, rolling_s, embree_s = in_turns(
        [
            lambda: caster.cast_lidar(lidar, place),
            lambda: caster.cast_lidar(lidar, place, Conditions(obstacles=crowd)),
            lambda: caster.cast_lidar(rolling, place, forward),
            lambda: np.minimum(
                run(origins.astype(np.float32), ways), scene.run(middle, ways, query="DISTANCE")
            ),
        ],
        seconds,
    )
    report.add(
        "moving",
        scene="five obstacles",
        ours_s=crowd_s,
        to="Embree, second scene",
        ratio=embree_s / crowd_s,
    )
    report.add("moving", scene="rolling", ours_s=rolling_s, to="still", ratio=still_s / rolling_s)
    del kept


def environments(report: Report, robots: int) -> None:
    """Count the steps of robots with a lidar of 16 x 180 beams, a second of CPU time."""
    lidar = replace(level(16, 180, 15.0), name="lidar")
    for world in ("city", "paper_room"):
        scenario = load_scenario(world).changed(lidars=[lidar])
        envs = DriveVectorEnv(robots, scenario)
        envs.reset(seed=0)
        actions = np.random.default_rng(0).uniform(-1.0, 1.0, (robots, 2))
        (step_s,) = in_turns([partial(envs.step, actions)], 0.0)
        report.add("environments", world=world, robots=robots, steps_each_s=robots / step_s)


# Boxes with tops, x, y, X, Y [m], and walls along beams and between boxes, from middles of sides.
ROWS = [(-6, -5), (-3, -1), (0, 1), (2, 4), (5, 6)]
BETWEEN = [(3, 0.5, 5, 0.5), (2.5, -5, 2.5, -3), (8.5, 1, 8.5, 2), (6, 3, 8, 3)]
BLOCKS = [(x, y, x + 1, Y) for y, Y in ROWS for x in range(2, 15, 3)] + BETWEEN

# Heights of boxes and of sensors [m]; neighbouring floats stand beside them.
TOPS = (0.25, 0.5, 0.75, 1.0)
EYES = (0.5, 0.625, 0.75, 1.0, 1.25)

# Directions of beams, many through corners.
WAYS = np.array([(x, y) for x in range(1, 17) for y in range(-16, 17)], float)

# Layers of a sensor: of beams along these directions, and of a lidar, which has few columns.
LAYERS = 64
LIDAR_LAYERS = 2048


def hardest(report: Report, beams: int) -> None:
    """Count wrong beams at edges of tops, corners, T-junctions and heights, by rationals."""
    rng = np.random.default_rng(0)
    done = {"along few directions": [0, 0], "a level lidar": [0, 0]}
    while done["along few directions"][0] < beams // 2:
        heights = nudged(rng.choice(TOPS, len(BLOCKS)), rng)
        world = world_of(heights)
        walls = StandingWalls(world)
        place = np.array([0.0, rng.integers(-48, 49) / 8, 0.0])
        z = float(nudged(rng.choice(EYES, 1), rng)[0])
        crossed = [crossings(place, way) for way in WAYS]
        slopes = np.array([aimed(each, heights, z, LAYERS, rng) for each in crossed])
        sensor = Layered.of(slopes, np.ones(LAYERS), LaserRangeFinder(range_max=1e6))
        rays = rays_along(place, WAYS)
        found, _ = _columns(walls, walls.standing(place, z), rays, z, sensor)
        check(done["along few directions"], found, crossed, heights, z, slopes)
        caster = PlanarCaster(world)
        while done["a level lidar"][0] < done["along few directions"][0]:
            # All layers are aimed at what one column crosses, which looks ahead.
            pose = (0.0, place[1], float(rng.uniform(-0.7, 0.7)) * rng.integers(2))
            ahead = LaserRangeFinder(0.0, 0.0, 1).directions(pose)
            steep = aimed(crossings(place, ahead[0]), heights, z, LIDAR_LAYERS, rng)
            lidar = Lidar(np.arctan(steep), 4, 0.0, 1e6, (0, 0, z))
            scan = caster.cast_lidar(lidar, pose)
            way = lidar.planar.directions(pose)[2:3]
            found = (scan.ranges / lidar.stretches[:, None]).T[2:3]
            crossed = [crossings(place, way[0])]
            check(done["a level lidar"], found, crossed, heights, z, lidar.slopes[None])
    for kind, (count, bad) in done.items():
        report.add("hardest", kind=kind, beams=count, wrong=bad)


def nudged(values: Float, rng: np.random.Generator) -> Float:
    """Values, of which some are moved to the next float below or above."""
    return np.nextafter(values, values + rng.integers(-1, 2, len(values)))


def world_of(heights: Float) -> World:
    """A world of blocks with heights: boxes, which are closed, and walls."""
    parts = [
        [[x, y, X, y], [X, y, X, Y], [X, Y, x, Y], [x, Y, x, y]] if x < X and y < Y else [block]
        for block in BLOCKS
        for x, y, X, Y in [block]
    ]
    owners = np.repeat(np.arange(len(parts)), [len(each) for each in parts])
    return World(np.concatenate(parts), owners, heights[owners])


def crossings(place: Float, way: Float) -> list[tuple[int, Fraction, Fraction]]:
    """The blocks that a beam from a place meets, and the t at which it enters and leaves them."""
    found = []
    d = [Fraction(each) for each in way.tolist()]
    o = [Fraction(each) for each in place[:2].tolist()]
    for number, block in enumerate(BLOCKS):
        enter = Fraction(0)
        leave = Fraction(10**9)
        for axis in (0, 1):
            ends = [Fraction(block[axis]) - o[axis], Fraction(block[axis + 2]) - o[axis]]
            if d[axis]:
                ends = sorted(each / d[axis] for each in ends)
                enter = max(enter, ends[0])
                leave = min(leave, ends[1])
            elif not ends[0] <= 0 <= ends[1]:
                leave = Fraction(-1)
        if enter <= leave:
            found.append((number, enter, leave))
    return found


def aimed(crossed: Any, heights: Float, z: float, layers: int, rng: Any) -> Float:
    """Slopes (layers,), ascending, at edges of tops and at feet, and just above and below them."""
    edges = [
        float(Fraction(rise) / t)
        for number, *ends in crossed
        for t in ends if t
        for rise in (heights[number] - z, -z)
    ]  # fmt: skip
    near = np.concatenate([np.nextafter(edges, -9.0), edges, np.nextafter(edges, 9.0), [0.0]])
    return np.sort(rng.choice(near, layers)) if edges else np.linspace(-1.0, 1.0, layers)


def check(
    count: list[int], found: Float, crossed: Any, heights: Float, z: float, slopes: Float
) -> None:
    """Count beams and wrong ones, of ranges (k, layers) along ways that cross blocks."""
    for row, own, s in zip(found, crossed, slopes, strict=True):
        with np.errstate(divide="ignore", over="ignore"):
            true = np.where(s < 0.0, -z / s, np.inf)
        for number, enter, leave in own:
            rise = Fraction(heights[number]) - Fraction(z)
            meets = not_above(s, rise, enter)
            true = np.where(meets, np.minimum(true, float(enter)), true)
            if rise < 0:
                down = ~meets & not_above(s, rise, leave)
                true[down] = np.minimum(true[down], float(rise) / s[down])
        true[true > 1e6] = np.inf
        count[0] += len(s)
        count[1] += int((~np.isclose(row, true, rtol=1e-12, atol=0.0)).sum())


def not_above(slopes: Float, rise: Fraction, t: Fraction) -> Any:
    """Which slopes (n,) are at t at most as high as a rise; equal floats are compared exactly."""
    if not t:
        return np.full(len(slopes), rise >= 0)
    edge = rise / t
    return (slopes < float(edge)) | ((slopes == float(edge)) & (Fraction(float(edge)) <= edge))


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
