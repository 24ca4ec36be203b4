"""``scripts/bench scan``: what does an exact scan cost, compared with other methods?

Every caster is timed and judged in cities of one density, from a room's number of walls to a
million; in a table and a picture each is a point of run time and largest error.
"""

import subprocess
import time
from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import Any
from unittest.mock import patch

from matplotlib.figure import Figure

from benchmarks.chart import COLOURS, OWN, RING, draw, scatter
from benchmarks.result import Result, Row, Table, metres, percent
from benchmarks.scan.accuracy import corner_trial, judge, scan_trial
from benchmarks.scan.baselines import BASELINES, Baseline, Call, Planar
from benchmarks.scan.baselines import OWN as OWN_CASTERS
from benchmarks.scan.processes import probe, resident_bytes
from benchmarks.scan.savings import ablate
from benchmarks.timing import Timing, take_turns
from lrf3d.casting import PlanarCaster, batch_caster
from lrf3d.cores import core_count
from lrf3d.laser import LaserRangeFinder
from lrf3d.progress import Progress, silent
from lrf3d.world.generators import city_crossings, generate_city

WALLS = (40, 400, 10_000, 100_000, 1_000_000)
"""Sizes of the worlds, where none are given."""

USUAL, HUGE = 400, 1_000_000
"""Walls of the usual city and of the huge one. PlanarCaster is timed in the usual one beside larger
ones too, so that nothing that slows the machine comes between the two."""

SECONDS = 150.0
"""Time for all [s], if none is given."""

TURNS_SHARE, ABLATION_SHARE = 0.5, 0.12
"""Parts of the time for the cities and for the ablation; the rest is for building and probes."""

STEPS = 3
"""Steps that a city reports."""

DRIVE, NEAR = 64, 3
"""Poses that single scans are timed at, and how many crossings a way they lie around the middle:
as on a drive, the same walls come into view again and again."""

BATCH = 4000
"""Poses of a batch."""

AWAKE = 0.1
"""How long a turn of several batches may take [s]: cores that a baseline left idle take some time
to be at full speed again."""

JUDGED_SCANS, JUDGED_CORNERS = 200, 20_000
"""Scans, and beams aimed at corners, that baselines are judged by; the slow ones by fewer."""

WEIGHED_WALLS = 100_000
"""Worlds from which on an index stands out from the noise of the process's memory."""

SLOW_BATCH = ("numpy", "mujoco")
"""Baselines whose batch is a loop over single scans: it would show nothing new."""

PROBED = ("planar", "embree")
"""Casters whose first call and memory are measured in processes of their own."""

CASTER_COLOURS = {
    "PlanarCaster": OWN, "EmbreeCaster": "#e8890c", "Embree float32": COLOURS[2],
    "trimesh location": COLOURS[4], "Open3D": COLOURS[0], "MuJoCo": COLOURS[1],
    "NumPy determinants": COLOURS[5],
}  # fmt: skip
"""Colours of casters by their title: lrf3d's own are warm."""

LRF = LaserRangeFinder()


def _rate(rays: float) -> str:
    return f"{rays / 1e6:.1f} M/s"


ENTRIES = Table(
    "entries",
    {
        "title": "caster",
        "walls": "walls",
        "scan": "scan",
        "largest_error_m": ("largest error", metres),
        "at_corners.wrong_wall_share": ("wrong walls", percent),
        "at_corners.over_1_cm_share": ("over 1 cm", percent),
        "batch.rays_per_s": ("batch", _rate),
        "batch_one_core.rays_per_s": ("one core", _rate),
        "index_bytes_per_wall": ("index", "{:.0f} B/wall".format),
    },
    f"scan: {LRF.beams} beams, range_max {LRF.range_max:g} m, the median. largest error: of all"
    " beams, against\nthe exact ranges, which scripts/stress certifies. wrong walls, over 1 cm: of"
    f" beams aimed within\n1e-9 to 1e-5 rad of corners. batch, one core: rays a second of {BATCH}"
    " scans in one call.",
    names=("title", "walls"),
    time="scan",
    error="largest_error_m",
)
"""Each caster in each world."""

PROCESSES = Table(
    "fresh_processes",
    {
        "caster": "fresh process",
        "import_s": "import",
        "first_scan_s": "first scan",
        "second_scan_s": "next scan",
        "output_bytes": "batch output",
        "peak_bytes": "batch peak",
    },
)
"""For each of lrf3d's casters the times of its first call [s], and the memory of a batch."""


def bench_scan(
    walls: Sequence[int] = WALLS,
    *,
    seconds: float = SECONDS,
    with_ablation: bool = False,
    progress: Progress = silent,
) -> Result:
    """Measure all casters in cities of given numbers of walls.

    Args:
        walls: Sizes of the cities; a size for which the time does not suffice is skipped.
        seconds: Time for all [s]; a step that has begun is finished.
        with_ablation: Also time each piece of skipped work on and off.
        progress: Called with the steps done, and of how many.
    """
    start = time.monotonic()
    result = Result(
        "scan",
        f"How long does a scan of {LRF.beams} beams take, and how far is its worst range off the"
        " exact one, which scripts/stress certifies with rationals?",
        {
            "beams": LRF.beams,
            "range_max_m": LRF.range_max,
            "batch_poses": BATCH,
            "exact_answers": "PlanarCaster's, certified by scripts/stress",
        },
        chart,
        {ENTRIES: [], PROCESSES: []},
    )
    total = STEPS * len(walls) + 2 * len(PROBED) + (1 if with_ablation else 0)
    done = 0

    def step(steps: int = 1) -> None:
        nonlocal done
        done += steps
        progress(done, total)

    absent = missing()
    result.skipped += absent.values()
    built = 0.0
    for number, count in enumerate(sorted(walls)):
        # Building grows with the walls; all else takes the time that it is given.
        share = TURNS_SHARE * seconds / len(walls)
        expected = built * count + share
        if number and time.monotonic() - start + expected > seconds:
            result.skipped.append(f"{count:,} walls: {seconds:g} s do not suffice")
            step(STEPS)
            continue
        rows, built = measure_city(count, share, absent, step)
        for row in rows:
            result.add(ENTRIES, **row)
    for caster in PROBED:
        _probe(result, caster)
        step(2)
    if with_ablation:
        ablate(result, seconds=ABLATION_SHARE * seconds, huge=max(walls))
        step()
    promise(result)
    result.took_s = time.monotonic() - start
    return result


def missing() -> dict[str, str]:
    """Load what all baselines need, which is no part of building an index.

    Returns:
        For each baseline that cannot take part its key and why.
    """
    absent = {}
    for kind in BASELINES:
        try:
            kind(generate_city(4), LRF).single(LRF, city_crossings(4, 1)[0])()
        except ImportError as error:
            absent[kind.key] = (
                f"{kind.title}: not installed ({error}); .venv/bin/pip install -e '.[bench]'"
            )
    return absent


def measure_city(
    walls: int,
    seconds: float,
    absent: Collection[str] = (),
    step: Callable[[], None] = lambda: None,
) -> tuple[list[Row], float]:
    """Build, time and judge all baselines in one city.

    Args:
        walls: How many walls the city is asked to have.
        seconds: Time for all turns and judgements [s]; building comes on top.
        absent: Keys of the baselines that do not take part.
        step: Called after each of the three steps.

    Returns:
        A row for each baseline, and the time of building for each wall [s].
    """
    world = generate_city(walls)
    walls = len(world.segments)
    built: dict[str, Baseline] = {}
    rows: dict[str, Row] = {}
    start = time.perf_counter()
    for kind in BASELINES:
        if walls > kind.most_walls or kind.key in absent:
            continue
        before, begin = _weigh(walls), time.perf_counter()
        baseline = built[kind.key] = kind(world, LRF)
        took = time.perf_counter() - begin
        baseline.single(LRF, city_crossings(walls, 1)[0])()
        grown = None if before is None else (_weigh(walls) or 0) - before
        index = baseline.index_bytes or grown
        rows[kind.key] = {
            "caster": kind.key,
            "title": kind.title,
            "walls": walls,
            "default": kind.key == "embree",
            "build_s": took,
            "index_bytes_per_wall": None if index is None else index / walls,
        }
    building = (time.perf_counter() - start) / walls
    step()
    turns = {key: _drive(baseline, walls) for key, baseline in built.items()}
    if walls > USUAL:
        turns["usual"] = _drive(Planar(generate_city(USUAL), LRF), USUAL)
    singles = take_turns(turns, seconds=seconds / 3.0)
    batches = _batches(built, walls, seconds / 3.0)
    step()
    caster = PlanarCaster(world)
    everywhere = city_crossings(walls, JUDGED_CORNERS, seed=1)
    trials = {
        "on_scans": scan_trial(caster, LRF, everywhere[:JUDGED_SCANS]),
        "at_corners": corner_trial(caster, world, everywhere),
    }
    for key, row in rows.items():
        single = row["scan"] = singles[key]
        row["scan_in_usual_city"] = singles.get("usual") if key == Planar.key else None
        row["scan_rays_per_s"] = LRF.beams / single.median
        for name, trial in trials.items():
            row[name] = judge(built[key], trial, seconds=seconds / 6.0 / len(built))
        row["largest_error_m"] = max(row[name]["largest_error_m"] for name in trials)
        for name, one_core in {"batch": "", "batch_one_core": ", one core"}.items():
            timing = batches.get(key + one_core)
            rate = timing and BATCH * LRF.beams / timing.median
            row[name] = timing and {**timing.as_dict(), "rays_per_s": rate}
    step()
    return list(rows.values()), building


def _drive(baseline: Baseline, walls: int) -> Callable[[int], object]:
    """Single scans along a drive, by the number of the turn."""
    calls = [baseline.single(LRF, pose) for pose in city_crossings(walls, DRIVE, spread=NEAR)]
    return lambda turn: calls[turn % len(calls)]()


def _batches(baselines: dict[str, Baseline], walls: int, seconds: float) -> dict[str, Timing]:
    """Time a batch of each baseline, and on one core too of those that use several."""
    poses = city_crossings(walls, BATCH, seed=2)
    turns: dict[str, Callable[[int], object]] = {}
    for key, baseline in baselines.items():
        if key in SLOW_BATCH:
            continue
        call = baseline.scans(LRF, poses)
        turns[key] = partial(_call, call)
        if isinstance(baseline, OWN_CASTERS):
            turns[f"{key}, one core"] = partial(_on_one_core, call)
    return take_turns(turns, seconds=seconds, burst_seconds=AWAKE)


def _call(call: Call, turn: int) -> object:
    return call()


def _on_one_core(call: Call, turn: int) -> object:
    """Call with casters that take the machine to have one core."""
    with patch.object(batch_caster, "core_count", lambda: 1):
        return call()


def _weigh(walls: int) -> int | None:
    """Memory of this process [bytes], where it is known and an index stands out from noise."""
    if walls < WEIGHED_WALLS:
        return None
    try:
        return resident_bytes()
    except OSError:
        return None


def _probe(result: Result, caster: str) -> None:
    """Measure a caster in fresh processes."""
    try:
        probe("first_call", caster, USUAL)  # The kernels are on disk after this one.
        calls = [probe("first_call", caster, USUAL) for _ in range(3)]
        middle = sorted(calls, key=lambda call: call["until_first_scan_s"])[1]
        memory = probe("memory", caster, USUAL)
        result.add(PROCESSES, caster=caster, **middle, **memory)
    except (OSError, subprocess.SubprocessError) as error:
        result.skipped.append(f"fresh processes of {caster}: {error}")


def promise(result: Result) -> None:
    """Add the promised ratios that can be formed from what was measured."""
    by = {(row["caster"], row["walls"]): row for row in result[ENTRIES]}
    for name, key, other, bound in (
        ("PlanarCaster / Embree float32", "planar", "raw", 0.7),
        ("EmbreeCaster / Embree float32", "embree", "raw", 1.6),
        ("EmbreeCaster / trimesh location", "embree", "location", 0.5),
    ):
        if (key, USUAL) in by and (other, USUAL) in by:
            value = by[key, USUAL]["scan"].median / by[other, USUAL]["scan"].median
            result.promise(f"one scan, {USUAL} walls: {name}", value, bound)
    huge = by.get(("planar", HUGE))
    if huge is not None and huge["scan_in_usual_city"] is not None:
        name = f"one scan: PlanarCaster at {HUGE:,} / {USUAL} walls"
        result.promise(name, huge["scan"].median / huge["scan_in_usual_city"].median, 1.3)
    peer = (by.get(("open3d", USUAL)) or {}).get("batch")
    for key in PROBED:
        row = by.get((key, USUAL))
        if row is None or row["batch"] is None or row["batch_one_core"] is None:
            continue
        title, rate = f"batch, {USUAL} walls: {row['title']}", row["batch"]["rays_per_s"]
        if peer is not None:
            name = f"{title} / Open3D, rays a second"
            result.promise(name, rate / peer["rays_per_s"], 1.5, at_least=True)
        gain = rate / row["batch_one_core"]["rays_per_s"] / core_count()
        result.promise(f"{title}, all cores / (cores × one core)", gain, 0.8, at_least=True)
    if huge is not None and huge["index_bytes_per_wall"] is not None:
        name = f"index of PlanarCaster, {HUGE:,} walls, bytes a wall"
        result.promise(name, huge["index_bytes_per_wall"], 100.0)
    for row in result[PROCESSES]:
        share = row["peak_bytes"] / row["output_bytes"]
        result.promise(f"memory of a batch / its output, {row['caster']}", share, 1.5)
        name = f"import to first scan in a fresh process [s], {row['caster']}"
        result.promise(name, row["until_first_scan_s"], 1.0)


def chart(result: Result) -> Figure:
    """Time and error of plain scans and at corners, and the rates of batches."""
    common: dict[str, Any] = {"rows": result[ENTRIES], "by": "title", "colours": CASTER_COLOURS}
    panels = [
        partial(
            scatter, **common, x="scan", y=f"{place}.largest_error_m", title=title,
            labels=("time of a scan", "largest error [m]"), note=lambda row: f"{row['walls']:,}",
        )
        for place, title in (("on_scans", "plain scans"), ("at_corners", "beams aimed at corners"))
    ]  # fmt: skip
    panels.append(
        partial(
            scatter, **common, x="walls", y="batch.rays_per_s", dashed="batch_one_core.rays_per_s",
            title="batches; dashed: on one core",
            labels=("walls of the world, at one density", "rays a second"),
        )
    )  # fmt: skip
    return draw([panels], (
        "Scans: run time against error",
        f"{LRF.beams} beams, range_max {LRF.range_max:g} m, in cities of one density  ·  a"
        f" point for each caster and world  ·  batches of {BATCH:,} scans  ·  {RING}",
    ))  # fmt: skip
