"""The city of Fig. 6 and 7: one drive, mapped in both modes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from benchmarks.chart import DASHES
from benchmarks.map.settings import MODES
from benchmarks.page import embed_figure, embed_frame
from benchmarks.paper.claim import Claim, Extent, Picture
from benchmarks.result import Table, duration, percent
from benchmarks.timing import time_updates
from lrf3d.errors import MissingLibraryError
from lrf3d.geometry import Float
from lrf3d.render.figures import draw_map
from lrf3d.robot import Trajectory
from lrf3d.run import Run
from lrf3d.scenario_file import load_scenario
from lrf3d.scoring import BuildingCount, MapScore, StorageCount, buildings_seen, score_run, storage
from lrf3d.scoring.summary import local_polylines
from lrf3d.sheet import FAINT, INK, MODE_COLOURS, quiet, sheet
from lrf3d.simulation import collect

FRAME_AT = 0.38
"""When in the drive the frame of Fig. 6 is taken, as a share of its time."""

WHOLE = 0.9
"""Least share of the buildings that were seen on all sides to come out as four segments."""

IN_TIME = 0.99
"""Least share of updates that take less than the time between two scans."""

SMOOTHED = 25
"""Updates over which a running median is drawn."""

MAPS = Table(
    "maps",
    {
        "mode": "mode",
        "map_segments": "segments",
        "unions": "unions",
        "buildings": "buildings whole",
        "segment_f1": ("segment F1", "{:.3f}".format),
        "length_f1": ("length F1", "{:.3f}".format),
        "perpendicular_rms": ("distance RMS", lambda rms: f"{1e3 * rms:.1f} mm"),
        "object_purity": ("object purity", "{:.3f}".format),
    },
)
"""Scores of the maps."""

UPDATES = Table(
    "updates",
    {"mode": "mode", "median_s": "median", "p99_s": "99th percentile", "largest_s": "largest",
     "in_time": ("in time", percent)},
)  # fmt: skip
"""Times of the updates."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive mapped in one mode.

    Args:
        run: The run.
        updates: The time of each update [s].
        score: The score of the map.
        buildings: How its buildings came out.
        stored: What the map takes.
    """

    run: Run
    updates: Float
    score: MapScore
    buildings: BuildingCount
    stored: StorageCount


def drive_through(world: str, mode: str, *, scans: int | None = None) -> Drive:
    """Drive through a built-in world, and map it in one mode."""
    scenario = load_scenario(world)
    drive = scenario.trajectory()
    simulation = scenario.simulation(
        drive=Trajectory(drive.times[:scans], drive.poses[:scans]),
        mode=mode,
        caster="planar",
        rng=0,
    )
    mapper: Any = simulation.mapper
    spent = time_updates(mapper)
    run = collect(simulation)
    polylines = [local_polylines(mapper.local_map(scan)) for scan in run.scans]
    return Drive(run, np.array(spent), score_run(run), buildings_seen(run), storage(run, polylines))


def film_claim(drive: Drive, extent: Extent) -> Claim:
    """Fig. 6: the robot in the city in 3D."""
    from lrf3d.render.video import frame

    run = drive.run
    time = float(run.trajectory.times[0] + FRAME_AT * run.trajectory.duration)
    pictures: tuple[Picture, ...] = ()
    try:
        caption = f"Fig. 6 redone: the robot in the city {time:.0f} s into its drive."
        pictures = (Picture(embed_frame(frame(run, time, size=extent.film)), caption),)
        found = (
            f"The walls are extruded to {run.world.object_count} buildings, and the film is drawn"
            " offscreen, without a window: robot, beams, reflecting points, and the map as it"
            " grows."
        )
    except MissingLibraryError as error:
        found = f"There is no picture: {error}."
    return Claim(
        "film",
        "The robot with its range finder is animated in a 3D city",
        "Section 2.4, Fig. 6",
        "The robot's pose and the ranges drive an animation in a 3D world that corresponds to the"
        " 2D one.",
        found,
        "the frame is drawn",
        {"lrf3d": bool(pictures) or None},
        pictures=pictures,
        data={"time_s": time, "buildings": run.world.object_count},
    )


def city_claim(drives: Mapping[str, Drive]) -> Claim:
    """Fig. 7: the map of the city, each building as four line segments."""
    run, counts = drives["robust"].run, {mode: drives[mode].buildings for mode in MODES}
    rows = [
        {
            "mode": mode,
            "unions": drives[mode].run.map.object_count,
            **drives[mode].score.as_dict(),
            "buildings": f"{count.whole} of {count.seen_on_all_sides}",
        }
        for mode, count in counts.items()
    ]
    return Claim(
        "city",
        "Each building of the city is represented with four line segments",
        "Section 4, Fig. 7",
        "The global map of the city, built at a largest range of 80 m and σ = 0.04 m, shows each"
        " building as a union of four line segments.",
        f"Along {run.trajectory.length:.0f} m and {len(run):,} scans,"
        f" {counts['robust'].seen_on_all_sides} of {counts['robust'].buildings} buildings are seen"
        f" on all sides. Of these, {counts['robust'].whole} are one union with one segment a wall"
        f" in robust mode, {counts['paper'].whole} in paper mode, where walls that are seen in"
        " pieces stay in pieces.",
        f"at least {100 * WHOLE:.0f} % of the buildings seen on all sides are one union of one"
        " segment a wall",
        {
            mode: count.whole >= WHOLE * seen if (seen := count.seen_on_all_sides) else None
            for mode, count in counts.items()
        },
        [(MAPS, rows)],
        [
            Picture(
                embed_figure(
                    draw_map(drives[mode].run, title=f"The city in {mode} mode"), lines=False
                ),
                f"Fig. 7 redone in {mode} mode.",
            )
            for mode in MODES
        ],
        {
            mode: {**drive.score.as_dict(), **drive.buildings.as_dict()}
            for mode, drive in drives.items()
        },
    )


def speed_claim(drives: Mapping[str, Drive]) -> Claim:
    """The mapping is fast enough for real time."""
    times = drives["robust"].run.trajectory.times
    interval = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    figures: dict[str, dict[str, Any]] = {}
    for mode in MODES:
        spent = drives[mode].updates
        figures[mode] = {
            "median_s": float(np.median(spent)),
            "p99_s": float(np.percentile(spent, 99.0)),
            "largest_s": float(spent.max()),
            "in_time": float((spent < interval).mean()),
        }
    figure = _draw_updates({mode: drives[mode].updates for mode in MODES}, interval)
    robust, paper = figures["robust"], figures["paper"]
    return Claim(
        "speed",
        "The mapping is fast enough for real time",
        "Section 5",
        "“The mapping algorithm is fast enough for real-time applications.”",
        f"An update with a scan of {drives['robust'].run.lrf.beams} beams takes"
        f" {1e3 * robust['median_s']:.2f} ms in robust mode, however large the map is, and"
        f" {1e3 * paper['median_s']:.1f} ms in paper mode, where it grows with the map. A scan"
        f" comes every {1e3 * interval:.0f} ms.",
        f"at least {100 * IN_TIME:.0f} % of the updates take less than the time between two scans",
        {mode: each["in_time"] >= IN_TIME for mode, each in figures.items()},
        [(UPDATES, [{"mode": mode, **each} for mode, each in figures.items()])],
        [Picture(embed_figure(figure), "The time of each update, on a logarithmic scale.")],
        {"scan_interval_s": interval, **figures},
    )


def _draw_updates(updates: Mapping[str, Float], interval: float) -> Figure:
    """The times of each update [s], by mode, beside the time between two scans [s]."""
    titles = (
        "Updates along the drive through the city",
        "a dot an update, the line a running median",
    )
    figure = sheet(10.4, 4.7, *titles)
    axes = quiet(figure.add_subplot())
    axes.set_yscale("log")
    for mode, colour in MODE_COLOURS.items():
        times = updates[mode]
        axes.plot(times, ".", ms=2.5, color=colour, alpha=0.35, zorder=3, mew=0)
        window = min(SMOOTHED, len(times))
        runs = np.lib.stride_tricks.sliding_window_view(times, window)
        middle = np.arange(len(runs)) + 0.5 * (window - 1)
        medians = np.median(runs, axis=1)
        axes.plot(middle, medians, color=colour, lw=1.8, zorder=5, label=f"{mode} mode")
    axes.axhline(interval, color=FAINT, lw=1.2, ls=DASHES, label="time between two scans")
    axes.set_ylim(top=2.5 * interval)
    axes.set_xlim(0, max(map(len, updates.values())))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda time, _: duration(time, 6)))
    axes.set_xlabel("scan of the drive", color=FAINT, fontsize=9)
    axes.set_ylabel("time of an update", color=FAINT, fontsize=9)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, frameon=False, fontsize=9,
                labelcolor=INK, borderaxespad=0.2)  # fmt: skip
    return figure
