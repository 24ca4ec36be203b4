"""The walls that a run has found at a moment: one count for all that films say of it."""

from functools import partial

import numpy as np

from lrf3d.base.latest import Latest
from lrf3d.geometry.lines import Bool, Float, Int
from lrf3d.mapping.line_map import LineMap
from lrf3d.scoring.map_score import found_walls, judged_part, visible_walls
from lrf3d.simulation.run import Run

# Number of maps of a run of which the walls found are counted, about.
_SCORED = 16

# The walls that the runs asked for last could see: those of a usual fleet.
_WALLS = Latest(8)

# Which of them their maps have found.
_FOUND = Latest(2 * _SCORED)


def visible_to(run: Run) -> tuple[Float, Int]:
    """The parts of walls (v, 4) that a run could see, and their walls (v,).

    None where the true walls are not known, or where nothing is mapped.
    """
    return _WALLS.of(run, partial(_visible, run))


def _visible(run: Run) -> tuple[Float, Int]:
    if run.knows_truth and len(run.maps) and len(run.world.segments):
        return visible_walls(judged_part(run))
    return np.zeros((0, 4)), np.zeros(0, np.int64)


def found_after(run: Run, scan: int) -> Bool:
    """Which of the walls that a run could see (v,) its map has found after a scan."""
    number = run.snapshot_after(scan)
    # Not each map is scored, but the last one is.
    if number < len(run.maps) - 1:
        number -= number % (1 + len(run.maps) // _SCORED)
    return _FOUND.of((run, number), partial(_found, run, number))


def lost_after(run: Run, scan: int) -> Float:
    """The parts of walls (n, 4) that its last map misses, once a run has ended with a scan."""
    ended = scan == len(run.trajectory.times) - 1
    return visible_to(run)[0][~found_after(run, scan)] if ended else np.zeros((0, 4))


def _found(run: Run, number: int) -> Bool:
    line_map = run.maps[number] if number >= 0 else LineMap.empty()
    return found_walls(line_map, visible_to(run)[0])
