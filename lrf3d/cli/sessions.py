"""``lrf3d localise MAP LOG``: a recorded drive on a map that is known."""

from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import numpy as np

from lrf3d.cli.console import Report, warn
from lrf3d.cli.folder import results_folder
from lrf3d.cli.logs import log_rows, timed
from lrf3d.geometry import Float
from lrf3d.io import LaserLog
from lrf3d.io.trajectory_files import save_tum
from lrf3d.mapping import LineMap
from lrf3d.pose import Pose, compose
from lrf3d.run import Run
from lrf3d.sessions import LocalisedLog, localise_log
from lrf3d.text import counted
from lrf3d.world import World


def localise_recorded(known: Run | World, log: LaserLog, args: Namespace, report: Report) -> None:
    """Find a recorded drive on a map."""
    with report.progress("scans") as progress:
        progress, milliseconds = timed(progress)
        found = localise_log(known, log, progress=progress)
    if not found.stretches:
        warn(f"{args.log}: nowhere on the map with certainty; the likeliest place has a"
             f" probability of {found.probability:.2g}")  # fmt: skip
    world = known.world if isinstance(known, Run) else known
    line_map = known.map if isinstance(known, Run) else LineMap.empty()
    true = None if isinstance(known, Run) else known
    chosen = np.flatnonzero(found.known)
    poses, times = found.poses[chosen], found.log.times[chosen]
    # The path is broken where the place is not known.
    ends = [np.searchsorted(chosen, each.last) + 1 for each in found.stretches[:-1]]
    drawn = np.insert(poses, ends, np.nan, axis=0)

    def draw(picture: Path) -> None:
        from lrf3d.render.figures import draw_map

        draw_map(line_map, picture, points=_points(found), poses=drawn,
                 world=true, title=f"{found.log.name} on {world.name or 'the map'}")  # fmt: skip

    output = results_folder(report, [args.world, args.log], f"{found.log.name}_localised", args.out)
    save_tum(times, poses, output.path / "trajectory.tum")
    rows = [*log_rows(log), ("map", f"{args.world}, {counted(len(world.segments), 'wall')}")]
    for each in found.stretches:
        x, y, theta = poses[np.searchsorted(chosen, each.first)]
        rows.append(("carried" if each.carried else "found", (
            f"scans {each.first} to {each.last}, first at ({x:.2f} m, {y:.2f} m,"
            f" {np.degrees(theta):.0f}°), probability {each.probability:.4f}")))  # fmt: skip
    count = len(found.poses)
    rows.append(("scans", f"{len(chosen):,} of {count:,} placed on the map"))
    rows.append(("time", f"{milliseconds():.2f} ms a scan"))
    output.finish(
        {**found.summary(), "milliseconds_a_scan": milliseconds()},
        {"trajectory": "trajectory.tum"},
        {"map picture": ("map.png", draw)},
        rows=rows,
        kept=f"{output.path / 'trajectory.tum'} holds the poses",
    )


def _points(found: LocalisedLog) -> Float:
    """What the scans hit (n, 2) whose places are known."""
    parts = [np.empty((0, 2))]
    for number in np.flatnonzero(found.known):
        scan = found.log.scans[number]
        laser = compose(found.poses[number], np.array(scan.mount))
        parts.append(replace(scan, pose=Pose(*laser.tolist())).points())
    return np.concatenate(parts)
