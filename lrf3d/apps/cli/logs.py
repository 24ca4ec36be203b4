"""``lrf3d map``, ``slam`` and ``localise``: logs with known poses, with odometry, and on a map."""

from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from math import radians
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from lrf3d.apps.cli.console import Console, warn
from lrf3d.apps.cli.folder import Drawing, ResultsFolder, draw_figure, new_file, results_folder
from lrf3d.apps.cli.inputs import MapAndLog, on_collision, routed
from lrf3d.apps.cli.runs import write_film
from lrf3d.base.errors import InputError
from lrf3d.base.files import make_folder
from lrf3d.base.formats import by_name
from lrf3d.base.interrupts import Progress
from lrf3d.base.text import counted
from lrf3d.geometry.pose import Pose, compose
from lrf3d.mapping import LineMap, save_map
from lrf3d.matching.surface import moved
from lrf3d.recordings import LaserLog, save_run
from lrf3d.recordings.degrade import degrade_log
from lrf3d.recordings.formats.carmen_writer import write_log
from lrf3d.recordings.formats.trajectory import load_relations, save_tum
from lrf3d.recordings.repair.repairs import repaired_log
from lrf3d.scoring import score_log, score_trajectory
from lrf3d.simulation.run import Run
from lrf3d.simulation.scenario import Scenario
from lrf3d.slam.offline import map_scans, solve_log
from lrf3d.slam.places import OdometryNoise
from lrf3d.slam.places.monte_carlo import FilterSettings, score_localisation
from lrf3d.slam.places.sessions import LocalisedLog, localise_log
from lrf3d.slam.solution import SolvedLog
from lrf3d.world import World

# Least share of the returns that a right map explains: 0.85 to 1 in buildings, less among trees.
LEAST_EXPLAINED = 0.6

# Largest share of the beams that pass through a right map: up to 0.1 in crowded offices.
MOST_VIOLATED = 0.2

# Extent of the poses [m] below which a laser is said to stand: less than half a robot. The noise of
# its poses adds up to metres of path.
STANDING = 0.2


def map_(log: LaserLog, args: Namespace, console: Console) -> None:
    """Map a log whose poses are known, and test the map."""
    mode = args.mode or "robust"
    output = results_folder(args, console, [args.log], log.name)
    log = repaired_log(log, args.without_repair or ())
    with _timed(console) as (progress, milliseconds):
        run = map_scans(log, mode=mode, sigma=args.sigma, all_scans=args.all, progress=progress)
    tests = [scan for scan, is_odd in zip(log.scans, log.is_odd, strict=True) if is_odd]
    score = score_log(run.map, [] if args.all else tests)
    bad = [{line.kind: line.number, "reason": line.reason} for line in log.bad_lines]
    summary = {
        "name": log.name,
        "mode": mode,
        "sigma_m": args.sigma,
        "log": {**log.counts, "poses": log.source, "first_bad_lines": bad},
        "map": {"segments": len(run.map), "objects": run.map.object_count},
        "score": score.as_dict(),
        "milliseconds_a_scan": milliseconds(),
    }
    share = explained = ""
    if score.returns:
        share = f"{100 * score.explained:.1f} % of the {score.returns:,} returns of the odd scans"
        explained = f"{share}, which it was not built from"
        if score.explained < LEAST_EXPLAINED:
            warn(f"the map explains only {share}: the poses are wrong, or few walls are there")
        elif score.violation > MOST_VIOLATED:
            through = f"{100 * score.violation:.0f} % of the beams of the odd scans"
            warn(f"{through} pass through the map: the poses drift; lrf3d slam finds others")
    rows = [
        ("poses", log.source),
        ("map", f"{run.map.counts}, {score.length:.0f} m long"),
        ("explains", explained),
        ("time", f"{milliseconds():.2f} ms a scan"),
    ]
    kept, drawings = _mapped(output, run, run)
    output.finish(
        summary,
        {"map": "map.geojson"},
        drawings,
        rows=[*log_rows(log), *_filled(rows)],
        following=["run", output.path / "map.geojson"],
        kept=kept,
    )


def slam(log: LaserLog, args: Namespace, console: Console) -> None:
    """Find poses and map of a log from odometry and scans."""
    known = None if args.relations is None else load_relations(args.relations)
    chosen = {} if args.key_distance is None else {"key_distance": args.key_distance}
    sources = [args.log] if args.on is None else [args.log, args.on]
    output = results_folder(args, console, sources, log.name)
    with _timed(console) as (progress, milliseconds):
        solved = solve_log(
            log, on=args.on, close=_in_order(args.close), apart=_in_order(args.not_),
            without_repairs=args.without_repair or (), progress=progress, **chosen,
        )  # fmt: skip
    score = None if known is None else score_trajectory(solved.line_poses, known).as_dict()
    for sentence in solved.warnings:
        warn(sentence)
    summary = {**solved.summary(), "score": score, "milliseconds_a_scan": milliseconds()}
    run = solved.run
    keys = np.array([key.scan for key in solved.key_scans[0]])
    kept, drawings = _mapped(output, run, run.part(keys))
    save_run(run, output.path / "run.npz")
    save_tum(*solved.placed_lines, output.path / "trajectory.tum")
    if args.video:
        drawings["video"] = "run.mp4", lambda path: write_film(run, path, args, console)
    if solved.tried:
        drawings["check picture"] = "check.png", partial(_draw_check, solved)
    output.finish(
        summary,
        {"map": "map.geojson", "run": "run.npz", "trajectory": "trajectory.tum"},
        drawings,
        rows=_slam_rows(solved, summary),
        following=["view", output.path],
        kept=kept,
    )


def _in_order(pairs: list[tuple[int, int]] | None) -> list[tuple[int, int]]:
    """Pairs of scans that were given, the earlier one first."""
    return [(min(pair), max(pair)) for pair in pairs or ()]


def _draw_check(solved: SolvedLog, picture: Path) -> None:
    """Draw where a map contradicts itself."""
    from lrf3d.studio.figures.figures import Pass, draw_check

    shown, poses = solved.key_scans
    surfaces = (moved(key.surface, pose) for key, pose in zip(shown, poses, strict=True))
    points = [np.column_stack([surface["x"], surface["y"]]) for surface in surfaces]
    scans = np.array([key.scan for key in shown])
    check = solved.check
    stretch = Pass(scans, points, *check.worst_scans, check.worst_violation, check.later)
    title = f"{solved.log.name}: where the map contradicts itself"
    draw_check(stretch, poses, solved.refused, title, picture)


def localise(source: Scenario | MapAndLog, args: Namespace, console: Console) -> None:
    """Localise a recorded drive on a known map; or simulated ones, and score that."""
    if isinstance(source, tuple):
        return _localise_recorded(*source, args, console)
    scenario = routed(source, args, console)
    sigma = scenario.sigmas[0] if args.sigma is None else args.sigma
    odometry = OdometryNoise(args.position, radians(args.heading))
    with console.progress("first run") as progress:
        run = scenario.run(
            mode="robust", sigma=sigma, rng=0, snapshots=1, on_collision=on_collision(args),
            progress=progress,
        )  # fmt: skip
    with console.progress("seeds") as progress:
        score = score_localisation(
            run, FilterSettings(sigma, odometry, args.strategy), known=args.known,
            seeds=args.seeds, workers=args.workers, progress=progress,
        )  # fmt: skip
    noise = {"position_m": args.position, "heading_deg": args.heading}
    console.print(
        {"name": scenario.name, "sigma_m": sigma, "odometry_noise": noise, **score},
        [
            ("known", f"{score['lines']} lines: the {args.known} of {scenario.name}"),
            ("drives", f"{score['seeds']}, of {score['scans']} scans each"),
            ("position", f"{score['mean_position_error_m']:.4f} m off on average, at most"
                         f" {score['largest_position_error_m']:.3f} m"),
            ("heading", f"{score['mean_heading_error_deg']:.4f}° off on average"),
        ],
    )  # fmt: skip


def _localise_recorded(
    known: Run | World, log: LaserLog, args: Namespace, console: Console
) -> None:
    output = results_folder(args, console, [args.world, args.log], f"{log.name}_localised")
    with _timed(console) as (progress, milliseconds):
        found = localise_log(
            known, log, without_repairs=args.without_repair or (), progress=progress
        )
    if not found.stretches:
        warn(f"{args.log}: nowhere on the map with certainty; the likeliest place has a"
             f" probability of {found.probability:.2g}")  # fmt: skip
    if found.map_scale != 1.0:
        share = abs(found.map_scale - 1.0)
        size = "larger" if found.map_scale > 1.0 else "smaller"
        warn(f"{args.world}: about {100.0 * share:.0f} % {size} than what the scans show: check its"
             " resolution, or the unit of the scans")  # fmt: skip
    world = known.world if isinstance(known, Run) else known
    chosen = np.flatnonzero(found.known)
    save_tum(found.log.times[chosen], found.poses[chosen], output.path / "trajectory.tum")
    rows = [*log_rows(log), *(("", note) for note in found.log.notes if note not in log.notes)]
    rows.append(("map", f"{args.world}, {counted(len(world.segments), 'wall')}"))
    for each in found.stretches:
        x, y, theta = found.poses[each.first]
        rows.append(("carried" if each.carried else "found", (
            f"scans {each.first} to {each.last}, first at ({x:.2f} m, {y:.2f} m,"
            f" {np.degrees(theta):.0f}°), probability {each.probability:.4f}")))  # fmt: skip
    rows += [
        ("scans", f"{len(chosen):,} of {len(found.poses):,} placed on the map"),
        ("time", f"{milliseconds():.2f} ms a scan"),
    ]
    output.finish(
        {**found.summary(), "milliseconds_a_scan": milliseconds()},
        {"trajectory": "trajectory.tum"},
        {"map picture": ("map.png", partial(_draw_places, known, found))},
        rows=rows,
        kept=f"{output.path / 'trajectory.tum'} holds the poses",
    )


def _draw_places(known: Run | World, found: LocalisedLog, picture: Path) -> None:
    """Draw the path of a drive, and what its scans show, on the map where it was found."""
    chosen = np.flatnonzero(found.known)
    poses = found.poses[chosen]
    points = [np.empty((0, 2))]
    for number, pose in zip(chosen.tolist(), poses, strict=True):
        scan = found.log.scans[number]
        laser = compose(pose, np.array(scan.mount))
        points.append(replace(scan, pose=Pose(*laser.tolist())).points())
    # The path is broken where the place is not known.
    ends = [np.searchsorted(chosen, each.last) + 1 for each in found.stretches[:-1]]
    line_map = known.map if isinstance(known, Run) else LineMap.empty()
    true = None if isinstance(known, Run) else known
    name = known.world.name if isinstance(known, Run) else known.name
    draw_figure(
        "map", line_map, picture, points=np.concatenate(points),
        poses=np.insert(poses, ends, np.nan, axis=0), world=true,
        title=f"{found.log.name} on {name or 'the map'}",
    )  # fmt: skip


def degrade(log: LaserLog, args: Namespace, console: Console) -> None:
    """Make a log worse on purpose, and write it."""
    out: Path = args.out
    written = by_name("log", "CARMEN").endings
    if not out.name.lower().endswith(written):
        raise InputError(f"--out {out}: expected a name that ends in {', '.join(written)}")
    changes = {name: vars(args)[name] for name in ("drop", "noise", "every", "beams_every")}
    worse = degrade_log(log, **changes, rng=args.seed)
    kept = degrade_log(log, every=args.every, beams_every=args.beams_every)
    make_folder(out.parent)
    with new_file(args, out, [args.log]) as place:
        write_log(worse, place)
    there, left = (sum(int(scan.hits.sum()) for scan in each.scans) for each in (kept, worse))
    thinned = f", one of {args.beams_every} beams" if args.beams_every > 1 else ""
    done = (
        f"{len(worse):,} of {counted(len(log), 'scan')} kept{thinned};"
        f" {there - left:,} of {there:,} returns lost, noise of {args.noise:g} m added to the"
        " others"
    )
    timed = sum(scan.time_increment != 0.0 for scan in log.scans)
    rows = [
        ("", f"{counted(timed, 'scan')} with times of beams, which are not kept" if timed else ""),
        ("poses", log.source),
        ("worse", done),
        ("file", str(out)),
    ]
    figures = {
        "file": str(out), "log": log.counts, "poses": log.source, **changes, "seed": args.seed,
        "scans": len(worse), "returns": there,
        "returns_lost": there - left,
    }  # fmt: skip
    console.print(figures, [*log_rows(worse), *_filled(rows)])


@contextmanager
def _timed(console: Console) -> Iterator[tuple[Progress, Callable[[], float]]]:
    """Progress by scans, and the mean time of a scan [ms] after the first, which compiles."""
    stamps: list[float] = []
    with console.progress("scans") as progress:

        def note(done: int, count: int) -> None:
            stamps.append(perf_counter())
            progress(done, count)

        yield note, lambda: 1000 * (stamps[-1] - stamps[0]) / max(len(stamps) - 1, 1)


def _filled(rows: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """The rows that have a text."""
    return [row for row in rows if row[1]]


def _mapped(output: ResultsFolder, run: Run, mapped: Run) -> tuple[str, dict[str, Drawing]]:
    """Write the map of a run, which a part of it made; where it is, and its picture."""
    draw = partial(
        draw_figure, "map", run.map, points=np.vstack([scan.points() for scan in mapped.scans]),
        poses=run.trajectory.poses, estimate=run.estimate, title=run.world.name,
    )  # fmt: skip
    save_map(run.map, output.path / "map.geojson", free=mapped.free_cells())
    return f"{output.path / 'map.geojson'} holds the map", {"map picture": ("map.png", draw)}


def log_rows(log: LaserLog, poses: str = "") -> list[tuple[str, str]]:
    """What a log held, and what was left out of it."""
    sizes = {len(scan.ranges) for scan in log.scans}
    beams = (f"{min(sizes):,} to " if len(sizes) > 1 else "") + counted(max(sizes), "beam")
    bad = [counted(log.bad_count, f"bad {line.kind}") for line in log.bad_lines[:1]]
    said = [f"{count} left out, the first {log.bad_lines[0]}" for count in bad]
    said += map(str, log.bad_lines[1:])
    if times := [scan.duration for scan in log.scans if scan.motion is not None]:
        taken = f"{counted(len(times), 'scan')} of up to {max(times):.3g} s unrolled"
        said.append(f"{taken}: each beam by its own time")
    if log.not_numbers:
        said.append(f"{counted(log.not_numbers, 'reading')} NaN: no return")
    first = ("log", f"{counted(len(log), 'scan')} of {beams}{poses}")
    return [first, *(("", text) for text in (*said, *log.notes))]


def _slam_rows(solved: SolvedLog, summary: dict[str, Any]) -> list[tuple[str, str]]:
    found = summary["slam"]
    lost = found["scans_by_odometry_alone"]
    closed = counted(found["loop_closures"], "loop closure")
    placed = solved.log.placed
    poses = f", {counted(summary['log']['odometry_lines'], 'pose')} by odometry"
    on = score = ""
    if (both := summary["joined"]) is not None:
        on = f"{both['on']}: found at scan {both['found_at']}, probability"
        on += f" {both['probability']:.4f}; {counted(both['ties'], 'loop closure')} with it"
    if summary["score"]:
        form = "{translation_mean:.4f} ± {translation_std:.4f} m, {rotation_mean:.2f} ±"
        score = f"{form} {{rotation_std:.2f}}° over {{relations}}".format(**summary["score"])
    drive = f"{found['length_m']:.0f} m"
    extent = float(np.hypot(*np.ptp(solved.run.trajectory.poses[:, :2], axis=0)))
    if extent < STANDING:
        drive = f"none: the laser stands, all poses lie within {extent:.2f} m"
    alone = f"{solved.odometry}; if that is mirrored, so is the map"
    rows = [
        ("odometry", "" if placed else alone),
        *(("", sentence) for sentence in solved.recording.sentences),
        ("drive", f"{drive}, {closed}"),
        ("", f"{counted(lost, 'scan')} matched nothing: placed as predicted" if lost else ""),
        ("on", on),
        ("map", solved.run.map.counts),
        *(("check", sentence) for sentence in solved.check.sentences() or [solved.check.unjudged]),
        ("relations", score),
        ("time", f"{summary['milliseconds_a_scan']:.2f} ms a scan"),
    ]
    return [*log_rows(solved.log, poses if placed else ""), *_filled(rows)]
