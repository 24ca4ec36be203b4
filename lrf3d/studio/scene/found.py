"""The walls that a run has found at a moment, and the false ones: one count for all films say."""

from collections.abc import Iterable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.base.text import counted
from lrf3d.geometry.lines import Bool, Float, Int, cross, directions
from lrf3d.mapping.line_map import LineMap
from lrf3d.scoring.map_score import found_walls, judged_part, visible_walls
from lrf3d.simulation.run import Run
from lrf3d.studio.scene.look import NOTHING
from lrf3d.studio.scene.marks import false_pieces
from lrf3d.studio.scene.shown import Shown
from lrf3d.studio.scene.stage.structures import walls_of
from lrf3d.world import World

# Number of maps of a run of which the walls found are counted, at most: usual runs keep fewer.
_SCORED = 128

# Share of its scans up to which those that hit a wall are few.
_FEW = 0.1

# Largest distance between the two sides of a thin wall [m].
_THIN = 0.3

# Distance from which on two sides are not in one line [m].
_APART = 0.01

# Sine of the angle up to which they are parallel.
_PARALLEL = 0.1

# Number of runs whose walls are kept: those of a usual fleet.
_RUNS = 8


@lru_cache(_RUNS)
def visible_to(run: Run) -> tuple[Float, Int]:
    """The parts of walls (v, 4) that a run could see, and their walls (v,).

    None where the true walls are not known, or where nothing is mapped.
    """
    if run.knows_truth and len(run.maps) and len(run.world.segments):
        return visible_walls(judged_part(run))
    return np.zeros((0, 4)), np.zeros(0, np.int64)


def found_after(run: Run, scan: int) -> Bool:
    """Which of the walls that a run could see (v,) its map has found after a scan."""
    number = run.snapshot_after(scan)
    # Not each map is scored, but the last one is.
    if number < len(run.maps) - 1:
        number -= number % (1 + len(run.maps) // _SCORED)
    return _found(run, number)


@lru_cache(2 * _SCORED)
def _found(run: Run, number: int) -> Bool:
    line_map = run.maps[number] if number >= 0 else LineMap.empty()
    return found_walls(line_map, visible_to(run)[0])


def lost_after(run: Run, scan: int) -> Float:
    """The parts of walls (n, 4) that its last map misses, once a run has ended with a scan."""
    ended = scan == len(run.trajectory.times) - 1
    return visible_to(run)[0][~found_after(run, scan)] if ended else NOTHING


class LostWalls(NamedTuple):
    """The walls that the last map of a run misses, and why."""

    # Their visible parts (n, 4), with the side that is missed on the left.
    parts: Float
    # How many they are, and why they are missed.
    words: str
    # The reason for each; "" where it is not known, or the same for all.
    reasons: list[str]


@lru_cache(_RUNS)
def lost_walls(run: Run) -> LostWalls:
    """The walls that the last map of a run misses, and why."""
    parts, walls = visible_to(run)
    found = found_after(run, len(run) - 1)
    lost = parts[~found]
    walls = walls[~found]
    if not len(lost):
        return LostWalls(lost, "", [])
    seen = [
        np.concatenate([scan.walls[scan.hits] for scan in run.scans_at(number)])
        for number in range(len(run))
    ]
    most = 1 + walls.max()
    beams = np.array([np.bincount(each[each >= 0], minlength=most)[walls] for each in seen])
    # The beams that hit a wall come from the side that is missed.
    robots = run.trajectory.poses[:, None, :2]
    sides = np.sign(cross(directions(lost), robots - lost[:, :2]))
    right = (beams * sides).sum(axis=0) < 0.0
    lost[right] = lost[right][:, [2, 3, 0, 1]]
    hits = (beams > 0).sum(axis=0)
    said = [f"hit in {counted(count, 'scan')}" for count in hits.tolist()]
    words = f"{len(lost)} missed"
    clear = walls_of(run.world, lambda material: material.passes)[walls]
    if clear.any():
        words += f", {clear.sum()} of glass"
        said = np.where(clear, "glass", "").tolist()
    elif hits.max() <= _FEW * len(run):
        least = f"{hits.min():,} to " * bool(hits.min() < hits.max())
        words += f", few hits: in {least}{hits.max():,} of {len(run):,} scans"
    else:
        words += ": the map has only the other side" * _have_other_sides(lost, parts[found])
        said = [""] * len(lost)
    return LostWalls(lost, words, said)


def _have_other_sides(lost: Float, found: Float) -> bool:
    """Whether each lost part of a wall (n, 4) has a found one on the other side of a thin wall."""
    middles = 0.5 * (lost[:, :2] + lost[:, 2:])
    tree = shapely.STRtree(shapely.linestrings(found.reshape(-1, 2, 2)))
    number, other = tree.query(shapely.points(middles), predicate="dwithin", distance=_THIN)
    along = directions(lost)[number]
    turned = np.abs(cross(along, directions(found)[other]))
    apart = np.abs(cross(along, found[other, :2] - middles[number]))
    behind = number[(turned < _PARALLEL) & (apart > _APART)]
    return len(np.unique(behind)) == len(lost)


def distances(run: Any, scan: int | None = None) -> str:
    """How many distances a run's laser has measured, up to a scan if one is given."""
    last = len(run.ranges) if scan is None else scan + 1
    return f"{np.isfinite(run.ranges[:last]).sum():,} distances"


def missed_by(runs: Iterable[Run]) -> tuple[Float, Int]:
    """The parts of walls (n, 4) that the maps of some runs miss, and how many of these do (n,)."""
    lost = np.concatenate([NOTHING, *(lost_after(run, len(run) - 1) for run in runs)])
    return np.unique(lost, axis=0, return_counts=True)


def hits_on(run: Run, part: Float) -> tuple[Float, float]:
    """What a run's scans have hit (n, 2) of the wall of a part (4,), and how far off it [m]."""
    parts, walls = visible_to(run)
    wall = walls[(parts == part).all(axis=1)]
    hits = [scan.points()[np.isin(scan.walls[scan.hits], wall)] for scan in run.scans]
    places = np.concatenate(hits)
    off = cross(places - part[:2], directions(part[None]))
    return places, float(np.sqrt((off**2).sum() / max(1, len(off))))


def false_after(run: Run, scan: int) -> int:
    """How many walls its map has after a scan where there is none, if the true ones are known."""
    number = run.snapshot_after(scan)
    return false_walls(run, number)[0] if number >= 0 and len(visible_to(run)[0]) else 0


def has_false_walls(run: Run, scan: int) -> bool:
    """Whether any of the maps of a run up to a scan that are scored has false walls."""
    scored = range(0, 1 + run.snapshot_after(scan), 1 + len(run.maps) // _SCORED)
    return run.knows_truth and any(false_walls(run, number)[0] for number in scored)


@lru_cache(2 * _SCORED)
def false_walls(run: Shown, number: int) -> tuple[int, Float]:
    """How many walls a map of a run has where there is none, and where their pieces lie (n, 2)."""
    pieces, owner, false = false_pieces(run.maps[number].segments, _tree(run.world))
    return len(np.unique(owner[false])), pieces[false].reshape(-1, 2, 2).mean(axis=1)


@lru_cache(_RUNS)
def _tree(world: World) -> shapely.STRtree:
    return shapely.STRtree(shapely.linestrings(world.segments.reshape(-1, 2, 2)))


def false_words(count: int) -> str:
    """Words on false walls, to follow others; none if there are none."""
    return f", {count} false" if count else ""
