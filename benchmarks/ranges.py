"""How long does a scan take, and how far is its worst range off the exact one?

lrf3d's casters, bare Embree, and the peers that are installed cast the same scans in cities of one
density. The exact ranges are PlanarCaster's, which the stress tests compare with fractions. Beams
of plain scans hardly ever come near what is hard, so as many again are aimed at corners.
"""

import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from typing import Annotated, Any

import numpy as np
import trimesh

from benchmarks.report import Figure, Report, numbers, scatter
from benchmarks.timing import take_turns
from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.geometry.lines import Float
from lrf3d.geometry.pose import compose
from lrf3d.laser import LaserRangeFinder, ProportionalNoise
from lrf3d.robot import Trajectory
from lrf3d.simulation.sensor import Sensor, poses_on
from lrf3d.world import World
from lrf3d.world.generators import BLOCK_SIDE, city_blocks, generate_city

LRF = LaserRangeFinder()

BEAM = LaserRangeFinder(angle_min=0.0, angle_max=0.0, beams=1)
"""One beam ahead: its direction is that of the pose."""

DRIVE, BATCH = 64, 4000
"""Poses that single scans are timed at, and poses of a batch."""

CORNERS = 20_000
"""Beams aimed within 1e-9 to 1e-5 rad of corners."""

FEW_BEAMS = (1, 4, 10, 30, 64)
"""Beams of short scans."""

SHORT_BATCH, RAYS = 1024, 1000
"""Poses of a batch of short scans, and rays in any direction that are cast at once."""

NUMPY = "NumPy determinants"

GROSS = 0.01
"""A range is grossly wrong when it is off by more than this [m]: lasers err by as much."""

MOST_WALLS = 10_000
"""Walls up to which NumPy and MuJoCo are asked: among more they take too long."""

Cast = Callable[[LaserRangeFinder, Float], Float]
"""What casts scans from poses (k, 3)."""

Ready = Callable[[Float], Callable[[], object]]
"""What makes ready for a scan from a pose (3,), as users of a library would do it beforehand."""


AISLE = 1.5
"""Largest offset of a pose from the centre of a crossing [m], clear of all buildings."""


def city_crossings(walls: int, count: int, *, seed: int = 0, spread: int | None = None) -> Float:
    """Poses (count, 3) at the crossings of a generated city of some walls, at any heading.

    They lie around its middle, ``spread`` crossings in each direction as on a drive, if given.
    """
    rng = np.random.default_rng(seed)
    crossings = np.maximum(np.array(city_blocks(walls)) - 1, 1)
    wide = crossings if spread is None else np.minimum(spread, crossings)
    cells = (crossings - wide) // 2 + rng.integers(0, wide, (count, 2))
    positions = BLOCK_SIDE * (cells + 0.5) + rng.uniform(-AISLE, AISLE, (count, 2))
    return np.column_stack([positions, rng.uniform(-np.pi, np.pi, count)])


def methods(world: World) -> dict[str, Callable[[], tuple[Cast, Ready]]]:
    """What builds each method for a world; it raises ImportError where a library is missing."""

    def own(kind: type[PlanarCaster | EmbreeCaster]) -> tuple[Cast, Ready]:
        caster = kind(world)
        return caster.cast_batch, lambda pose: partial(caster.cast, LRF, tuple(pose.tolist()))

    def plain(cast: Cast) -> tuple[Cast, Ready]:
        return cast, lambda pose: partial(cast, LRF, pose[None])

    return {
        "PlanarCaster": lambda: own(PlanarCaster),
        "EmbreeCaster": lambda: own(EmbreeCaster),
        "bare Embree": lambda: bare_embree(world),
        NUMPY: lambda: plain(partial(determinants, world.segments)),
        "Open3D": lambda: plain(open3d_ranges(world)),
        "MuJoCo": lambda: plain(mujoco_ranges(world)),
    }


def bench(
    *,
    walls: Annotated[str, "Sizes of the cities [walls]."] = "40,400,10000,100000",
    seconds: Annotated[float, "Time for each city [s]."] = 10.0,
    figure: Figure = None,
) -> Report:
    """Cast scans with lrf3d and with its peers: run time against error.

    Open3D and MuJoCo take part where installed: .venv/bin/pip install -e '.[bench]'.
    """
    report = Report(__doc__.splitlines()[0])
    for count in numbers("--walls", walls, least=4):
        measure(report, count, seconds)
    short_scans(report, seconds)
    single_rays(report, seconds)
    savings(report, seconds)
    report.notes.append(
        f"scan: {LRF.beams} beams, range_max {LRF.range_max:g} m, the median. error: the largest of"
        " all beams.\nover 1 cm: of beams aimed within 1e-9 to 1e-5 rad of corners. batch: of"
        f" {BATCH:,} scans, a beam."
    )
    if figure is not None:
        labels = "time of a scan [s]", "largest error [m]"
        scatter(figure, report.tables["ranges"], "scan_s", "error_m", "method", labels, "walls")
    return report


def measure(report: Report, count: int, seconds: float) -> None:
    """Time and judge all methods in one city."""
    world = generate_city(count)
    exact = PlanarCaster(world)
    poses = city_crossings(count, DRIVE, spread=3)
    many = city_crossings(count, BATCH, seed=2)
    corners = corner_poses(exact, world, city_crossings(count, CORNERS, seed=1))
    built: dict[str, tuple[Cast, Ready, float]] = {}
    for name, make in methods(world).items():
        begin = time.perf_counter()
        try:
            cast, ready = make()
            ready(poses[0])()
        except ImportError as error:
            report.notes.append(f"left out: {error}")
            continue
        if name not in (NUMPY, "MuJoCo") or count <= MOST_WALLS:
            built[name] = cast, ready, time.perf_counter() - begin
    singles = take_turns(
        {name: partial(_scan, list(map(ready, poses))) for name, (_, ready, _) in built.items()},
        seconds=seconds / 2,
    )
    batches = take_turns(
        {name: partial(_batch, cast, many) for name, (cast, *_) in built.items() if name != NUMPY},
        seconds=seconds / 2,
    )
    for name, (cast, _, took) in built.items():
        plain, at_corners = (
            errors(cast(lrf, where), exact.cast_batch(lrf, where), lrf)
            for lrf, where in ((LRF, poses), (BEAM, corners))
        )
        report.add(
            "ranges",
            method=name,
            walls=len(world.segments),
            build_s=took,
            scan_s=singles[name].median,
            error_m=max(plain.max(), at_corners.max()),
            over_1_cm_share=float((at_corners > GROSS).mean()),
            batch_s=batches[name].median / (BATCH * LRF.beams) if name in batches else None,
        )


def short_scans(report: Report, seconds: float) -> None:
    """Single scans of few beams among 400 walls, as multiples of bare Embree on prepared rays."""
    world = generate_city(400)
    planar, poses = PlanarCaster(world), city_crossings(400, DRIVE)
    many = city_crossings(400, SHORT_BATCH, seed=2)
    try:
        bare, prepared = bare_embree(world)
    except ImportError as error:
        report.notes.append(f"left out: {error}")
        return
    for beams in FEW_BEAMS:
        lrf = LaserRangeFinder(beams=beams)
        timed = take_turns(
            {
                "bare": partial(_scan, [prepared(pose, lrf) for pose in poses]),
                "ranges": partial(_scan, [partial(planar.ranges, lrf, pose) for pose in poses]),
                "cast": partial(_scan, [partial(planar.cast, lrf, pose) for pose in poses]),
            },
            seconds=seconds / 10,
        )  # fmt: skip
        base = timed["bare"].median
        batch = take_turns(
            {"bare": _repeated(prepared(many, lrf)),
             "own": _repeated(partial(planar.cast_batch, lrf, many))},
            seconds=seconds / 10,
        )  # fmt: skip
        report.add(
            "short scans",
            beams=beams,
            ranges_to_bare=timed["ranges"].median / base,
            cast_to_bare=timed["cast"].median / base,
            batch_to_bare=batch["own"].median / batch["bare"].median,
            bare_error_m=errors(bare(lrf, poses), planar.cast_batch(lrf, poses), lrf).max(),
        )


def single_rays(report: Report, seconds: float) -> None:
    """Rays in any direction and scans of a robot that drives on, as multiples of bare Embree."""
    world = generate_city(400)
    planar = PlanarCaster(world)
    try:
        bare, prepared = bare_embree(world)
    except ImportError:
        return
    rays = city_crossings(400, RAYS, seed=3)
    ways = np.column_stack([np.cos(rays[:, 2]), np.sin(rays[:, 2])])
    work: dict[str, tuple[Float, Callable[[], Float]]] = {
        "rays": (rays, lambda: planar.cast_rays(rays[:, :2], ways, LRF)[0])
    }
    for beams in (LRF.beams, 1081):
        lrf = LaserRangeFinder(beams=beams, scan_duration=0.02)
        motion = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.03]])
        path = Trajectory([0.0, 0.1], compose(rays[:1], motion))
        sensor = Sensor(world, lrf, caster=planar, noise=ProportionalNoise(0.0), path=path)
        each = poses_on(path, rays[0], lrf.delays) + np.outer(lrf.angles, [0.0, 0.0, 1.0])
        work[f"rolling scan, {beams} beams"] = each, partial(_rolling, sensor, rays[0])
    for name, (poses, own) in work.items():
        timed = take_turns(
            {"bare": _repeated(prepared(poses, BEAM)), "own": _repeated(own)}, seconds=seconds / 10
        )
        exact = planar.cast_batch(BEAM, poses)
        report.add(
            "single rays",
            work=name,
            own_to_bare=timed["own"].median / timed["bare"].median,
            error_m=errors(own()[:, None], exact, BEAM).max(),
            bare_error_m=errors(bare(BEAM, poses), exact, BEAM).max(),
        )


def _rolling(sensor: Sensor, pose: Float) -> Float:
    """The ranges of a rolling scan."""
    return sensor.cast(pose, 0.0).ranges


def _repeated(call: Callable[[], object]) -> Callable[[int], object]:
    return lambda turn: call()


def _scan(calls: Sequence[Callable[[], object]], turn: int) -> object:
    return calls[turn % len(calls)]()


def _batch(cast: Cast, poses: Float, turn: int) -> object:
    return cast(LRF, poses)


def corner_poses(caster: PlanarCaster, world: World, poses: Float, *, seed: int = 0) -> Float:
    """Poses whose beam ahead passes right beside one end of the wall that it sees."""
    rng = np.random.default_rng(seed)
    seen = caster.scan_batch(BEAM, poses)[1][:, 0]
    poses, seen = poses[seen >= 0].copy(), seen[seen >= 0]
    either = rng.integers(0, 2, len(seen))
    ends = world.segments[seen].reshape(-1, 2, 2)[np.arange(len(seen)), either]
    aside = rng.choice([-1.0, 1.0], len(seen)) * 10.0 ** rng.uniform(-9.0, -5.0, len(seen))
    to_end = ends - poses[:, :2]
    poses[:, 2] = np.arctan2(to_end[:, 1], to_end[:, 0]) + aside
    return poses


def errors(ranges: Float, exact: Float, lrf: LaserRangeFinder) -> Float:
    """How far ranges are off [m]; a beam without return counts as one of range_max."""
    off: Float = np.abs(np.clip(ranges, 0.0, lrf.range_max) - np.clip(exact, 0.0, lrf.range_max))
    return off


def determinants(segments: Float, lrf: LaserRangeFinder, poses: Float) -> Float:
    """Section 2.3 of Teslić et al. to the letter: every beam against every wall, in NumPy."""
    found = []
    for pose in poses:
        beams = np.asarray(lrf.directions(pose))
        starts, spans = segments[:, :2] - pose[:2], segments[:, 2:] - segments[:, :2]
        across = np.outer(beams[:, 0], spans[:, 1]) - np.outer(beams[:, 1], spans[:, 0])
        ahead = starts[:, 0] * spans[:, 1] - starts[:, 1] * spans[:, 0]
        aside = np.outer(beams[:, 1], starts[:, 0]) - np.outer(beams[:, 0], starts[:, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            distance, place = ahead / across, aside / across
        distance[~((distance >= 0.0) & (place >= 0.0) & (place <= 1.0))] = np.inf
        found.append(distance.min(axis=1))
    return limited(np.array(found), lrf)


def limited(distances: Float, lrf: LaserRangeFinder) -> Float:
    """Ranges after REP 117."""
    far = np.where(distances > lrf.range_max, np.inf, distances)
    ranges: Float = np.where(far < lrf.range_min, -np.inf, far)
    return ranges


def mesh_of(world: World) -> trimesh.Trimesh:
    """The extruded walls around the origin, two triangles a wall."""
    walls = world.segments - np.tile(world.origin, 2)
    corners = np.zeros((len(walls), 4, 3))
    corners[:, [0, 3], :2], corners[:, [1, 2], :2] = walls[:, None, :2], walls[:, None, 2:]
    corners[:, 2:, 2] = 3.0
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(walls))[:, None, None]
    return trimesh.Trimesh(corners.reshape(-1, 3), faces.reshape(-1, 3), process=False)


def rays(world: World, lrf: LaserRangeFinder, poses: Float) -> tuple[Any, Any]:
    """Origins and directions (k beams, 3) in float32 of scans at poses (k, 3)."""
    directions = np.concatenate([np.asarray(lrf.directions(pose)) for pose in poses])
    origins = np.repeat(poses[:, :2] - world.origin, lrf.beams, axis=0)
    level = np.ones((len(origins), 1))
    return (
        np.hstack([origins, level]).astype(np.float32),
        np.hstack([directions, 0.0 * level]).astype(np.float32),
    )


def bare_embree(world: World) -> tuple[Cast, Callable[..., Callable[[], object]]]:
    """``EmbreeScene.run`` of embreex: the bare float32 library."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    mesh, scene = mesh_of(world), EmbreeScene()
    held = TriangleMesh(scene, mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32))

    def cast(lrf: LaserRangeFinder, poses: Float) -> Float:
        assert held is not None
        found = scene.run(*rays(world, lrf, poses), output=1)
        distances = np.where(found["primID"] >= 0, found["tfar"].astype(np.float64), np.inf)
        return limited(distances.reshape(len(poses), lrf.beams), lrf)

    def prepared(pose: Float, lrf: LaserRangeFinder = LRF) -> Callable[[], object]:
        return partial(scene.run, *rays(world, lrf, np.atleast_2d(pose)))

    return cast, prepared


def open3d_ranges(world: World) -> Cast:
    """Open3D's ``RaycastingScene``: Embree on all cores."""
    library: Any = import_module("open3d")
    mesh, scene = mesh_of(world), library.t.geometry.RaycastingScene()
    scene.add_triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))

    def cast(lrf: LaserRangeFinder, poses: Float) -> Float:
        found = scene.cast_rays(library.core.Tensor(np.hstack(rays(world, lrf, poses))))
        distances = found["t_hit"].numpy().astype(np.float64)
        return limited(distances.reshape(len(poses), lrf.beams), lrf)

    return cast


def mujoco_ranges(world: World) -> Cast:
    """MuJoCo's ``mj_multiRay`` at walls as thin boxes: in float64 as lrf3d."""
    library: Any = import_module("mujoco")
    spec = library.MjSpec()
    mujoco_boxes(spec.worldbody, world.segments - np.tile(world.origin, 2), library)
    model = spec.compile()
    data = library.MjData(model)
    library.mj_forward(model, data)

    def cast(lrf: LaserRangeFinder, poses: Float) -> Float:
        found, met = np.empty((len(poses), lrf.beams)), np.empty(lrf.beams, np.int32)
        for row, pose in zip(found, poses, strict=True):
            beams = np.pad(np.asarray(lrf.directions(pose)), ((0, 0), (0, 1))).ravel()
            eye = np.append(pose[:2] - world.origin, 0.0)
            library.mj_multiRay(
                model, data, eye, beams, None, 1, -1, met, row, None, lrf.beams, lrf.range_max
            )
        return limited(np.where(found < 0.0, np.inf, found), lrf)

    return cast


def mujoco_boxes(body: Any, segments: Float, library: Any) -> None:
    """Add segments (n, 4) to a body as thin boxes."""
    for x, y, u, v in segments.tolist():
        turn, size = 0.5 * np.arctan2(v - y, u - x), [0.5 * np.hypot(u - x, v - y), 1e-12, 3.0]
        quat, place = [np.cos(turn), 0.0, 0.0, np.sin(turn)], [0.5 * (x + u), 0.5 * (y + v), 0.0]
        kind = library.mjtGeom.mjGEOM_BOX
        body.add_geom(type=kind, size=size, pos=place, quat=quat)


def savings(report: Report, seconds: float) -> None:
    """Pieces of work that casting skips, each timed with it skipped and with it done."""
    town, quarter = generate_city(10_000), generate_city(400)
    planar, poses = PlanarCaster(quarter), city_crossings(400, DRIVE)
    near, all_walls = PlanarCaster(town), LaserRangeFinder(range_max=1e6)
    short, origin = LaserRangeFinder(range_max=10.0), (0.0, 0.0, 0.0)
    scan, rng = planar.cast(LRF, (10.0, 10.0, 0.0)), np.random.default_rng(0)
    still, noisy = ProportionalNoise(0.0), ProportionalNoise(0.04)
    places = [tuple(pose) for pose in poses.tolist()]
    for work, without, done in (
        ("walls beyond 10 m among 10,000, a scan",
         lambda turn: near.cast(short, places[turn % DRIVE]),
         lambda turn: near.cast(all_walls, places[turn % DRIVE])),
        ("walls that no beam comes near, among 400, a scan",
         lambda turn: planar.cast(LRF, places[turn % DRIVE]),
         lambda turn: determinants(quarter.segments, LRF, poses[turn % DRIVE][None])),
        ("building the 400 static walls for every scan",
         lambda turn: planar.cast(LRF, places[turn % DRIVE]),
         lambda turn: PlanarCaster(quarter).cast(LRF, places[turn % DRIVE])),
        ("the mesh of 10,000 walls for a planar cast",
         lambda _: PlanarCaster(town).cast(LRF, origin),
         lambda _: EmbreeCaster(town).cast(LRF, origin)),
        ("drawing noise at σ = 0, a scan",
         lambda _: still(scan, rng), lambda _: noisy(scan, rng)),
    ):  # fmt: skip
        timed = take_turns({"without": without, "done": done}, seconds=seconds / 10)
        report.save(work, timed["without"].median, timed["done"].median)
