"""MapScore: the agreement of a map of line segments with the walls that a run could see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import isfinite
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError, expect
from lrf3d.base.text import counted
from lrf3d.geometry.lines import (
    Bool,
    Float,
    Int,
    as_rows,
    cross,
    directions,
    lengths,
    number,
    numbers,
)  # fmt: skip
from lrf3d.laser import beam_directions
from lrf3d.mapping import LineMap
from lrf3d.planning.rooms import shown_share
from lrf3d.scoring.matching import (
    LEAST_VISIBLE,
    REACH,
    match_segments,
    sample_counts,
    sample_offsets,
)
from lrf3d.simulation.run import Run
from lrf3d.world.pieces import TOUCHING, joined_objects

# Largest number of scans from which visible walls are computed: a random sample of a long run shows
# as much of the walls, and the time does not grow with the run.
MOST_JUDGED = 2000

# Largest distance of a right sample from a wall [m], and angle between their segments [rad].
_NEAR = {"reach": REACH, "angle": float(np.deg2rad(5))}


class Report:
    """A dataclass of counts and figures that can be written as JSON."""

    __slots__ = ()

    def as_dict(self) -> dict[str, Any]:
        """The figures by name; None for values that are not finite, which JSON lacks."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]
        return {name: value if isfinite(value) else None for name, value in values.items()}


def visible_walls(run: Run, least: float = LEAST_VISIBLE) -> tuple[Float, Int]:
    """The part of each wall between the outermost noise-free returns of a run.

    Returns:
        (v, 4) the parts longer than a least length [m], and (v,) their walls, in ascending order.
    """
    expect(run, Run, "run")
    least = number(least, "least length", "metres")
    low, high = _outermost(run)
    visible = np.flatnonzero(high - low > least)
    start = run.world.segments[visible, :2]
    unit = directions(run.world.segments)[visible]
    first = start + low[visible, None] * unit
    return np.hstack([first, start + high[visible, None] * unit]), visible


def _outermost(run: Run) -> tuple[Float, Float]:
    """How far along each wall [m] its outermost noise-free returns lie; it is kept in the run."""
    kept = vars(run)
    if "_outermost" in kept:
        return kept["_outermost"]  # type: ignore[no-any-return]
    segments = run.world.segments
    along = directions(segments)
    size = lengths(segments)
    low = np.full(len(segments), np.inf)
    high = np.full(len(segments), -np.inf)
    for scan in run.true_scans:
        returned = (scan.walls >= 0) & scan.hits
        wall = scan.walls[returned]
        # Relative to the end of the wall, so that no digits are lost far from the origin.
        ahead = beam_directions(scan.pose.theta, scan.angles[returned])
        offset = np.array(scan.pose[:2]) - segments[wall, :2] + scan.ranges[returned, None] * ahead
        # What came by way of a mirror shows an image of the wall, elsewhere.
        station = (offset * along[wall]).sum(axis=1)
        direct = np.abs(cross(along[wall], offset)) < TOUCHING
        direct &= (station > -TOUCHING) & (station < size[wall] + TOUCHING)
        wall = wall[direct]
        station = station[direct]
        np.minimum.at(low, wall, station)
        np.maximum.at(high, wall, station)
    kept["_outermost"] = low, high
    return low, high


def seen_share(run: Run) -> float | None:
    """The visible share of the walls that face the drive's side, those of unreached rooms included.

    Examples:
        >>> import lrf3d
        >>> from lrf3d.scoring.map_score import seen_share
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> round(seen_share(run), 1)
        0.4
    """
    expect(run, Run, "run")
    return shown_share(run.world, run.trajectory.poses[:, :2], *visible_walls(run, 0.0))


@dataclass(frozen=True, slots=True)
class MapScore(Report):
    """The agreement of a map with the truth.

    Args:
        length_precision: Share of samples along the map that lie within 0.1 m and 5° of a true
            wall.
        length_recall: Share of samples along the visible walls that lie as near to a map segment.
        length_f1: Harmonic mean of the two.
        segment_precision: Share of map segments that match a visible wall one to one.
        segment_recall: Share of visible walls that are matched.
        segment_f1: Harmonic mean of the two.
        segment_ratio: Map segments divided by visible walls; ideally 1.
        perpendicular_rms: Root mean square distance of the right map samples from the line of
            their wall [m]; NaN where there are none.
        object_purity: Adjusted Rand index of the map's objects against true objects, over matched
            segments; true objects that touch count as one.
        map_segments: Number of segments in the map.
        visible_segments: Number of visible walls.
        matched_segments: Number of pairs of the two.
        found_segments: Number of visible walls that map segments cover, within the same limits,
            along at least half of their length.
    """

    length_precision: float
    length_recall: float
    length_f1: float
    segment_precision: float
    segment_recall: float
    segment_f1: float
    segment_ratio: float
    perpendicular_rms: float
    object_purity: float
    map_segments: int
    visible_segments: int
    matched_segments: int
    found_segments: int


def found_words(score: Mapping[str, Any]) -> str:
    """The walls that a map has found, in words, for summaries, films and pages.

    Examples:
        >>> from lrf3d.scoring.map_score import found_words
        >>> found_words({"found_segments": 21, "visible_segments": 22, "length_recall": 0.97})
        '21 of 22 visible walls found, 97.0 % of their length'
    """
    if not score["visible_segments"]:
        return "no wall is long enough to be looked for"
    found = f"{score['found_segments']} of {counted(score['visible_segments'], 'visible wall')}"
    return f"{found} found, {100 * score['length_recall']:.1f} % of their length"


def score_run(run: Run) -> MapScore:
    """Score the final map of a run against the walls that its beams could see.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> bool(lrf3d.score_run(run).length_precision > 0.9)
        True
    """
    segments, walls = visible_walls(run)
    in_reach = run.world.heights >= min(lrf.height for lrf in run.lasers)
    return score_map(
        run.map, segments, joined_objects(run.world)[walls], walls=run.world.segments[in_reach]
    )


def score_map(
    line_map: LineMap,
    visible_segments: Float,
    visible_objects: Int,
    *,
    walls: Float | None = None,
) -> MapScore:
    """Score a map against the visible parts of the true walls.

    These are the visible segments (v, 4), see :func:`visible_walls`, each of an object (v,). Any of
    all true walls (n, 4) makes a map sample right; only the visible parts if they are not given.
    The precision of an empty map is 1, and so is the recall if nothing is visible.

    Examples:
        >>> import lrf3d
        >>> walls = [[0.0, 0.0, 4.0, 0.0], [4.0, 0.0, 4.0, 3.0]]
        >>> import numpy as np
        >>> line_map = lrf3d.LineMap(np.array(walls[:1]), np.array([0]), np.array([9]))
        >>> score = lrf3d.score_map(line_map, np.array(walls), np.array([0, 0]))
        >>> round(score.length_precision, 2), round(score.length_recall, 2)
        (1.0, 0.57)
    """
    expect(line_map, LineMap, "map")
    found = line_map.segments
    visible = as_rows(visible_segments, "visible segments", 4)
    walls = visible if walls is None else as_rows(walls, "walls", 4)
    if (visible_objects := numbers(visible_objects, "visible objects")).shape != visible.shape[:1]:
        raise InputError(
            f"visible objects of shape {visible_objects.shape}: expected one a segment"
        )
    offsets = sample_offsets(found, walls, **_NEAR)
    right = np.isfinite(offsets)
    recalled, covered = _recalled(visible, found)
    precision = _share(right.sum(), len(right))
    recall = _share(recalled.sum(), len(recalled))
    pairs = match_segments(found, visible)
    matched = _share(len(pairs), len(found))
    there = _share(len(pairs), len(visible))
    return MapScore(
        precision,
        recall,
        _harmonic_mean(precision, recall),
        matched,
        there,
        _harmonic_mean(matched, there),
        segment_ratio=len(found) / len(visible) if len(visible) else np.inf if len(found) else 1.0,
        perpendicular_rms=float(np.sqrt(np.mean(offsets[right] ** 2))) if right.any() else np.nan,
        object_purity=adjusted_rand_index(
            line_map.objects[pairs[:, 0]], visible_objects[pairs[:, 1]]
        ),
        map_segments=len(found),
        visible_segments=len(visible),
        matched_segments=len(pairs),
        found_segments=int(covered.sum()),
    )


def found_walls(line_map: LineMap, visible_segments: Float) -> Bool:
    """Which visible parts of walls (v, 4) a map has found: those that it covers by half."""
    return _recalled(visible_segments, line_map.segments)[1]


def _recalled(visible: Float, found: Float) -> tuple[Bool, Bool]:
    """Which samples (s,) along visible walls, and which walls (v,), map segments (n, 4) cover."""
    recalled = np.isfinite(sample_offsets(visible, found, **_NEAR))
    # A wall counts as found if the map covers half of it.
    least_found = 0.5
    samples = sample_counts(visible)
    along = np.bincount(np.repeat(np.arange(len(visible)), samples), recalled, len(visible))
    return recalled, along >= least_found * samples


def _share(part: int, whole: int) -> float:
    return float(part / whole) if whole else 1.0


def _harmonic_mean(first: float, second: float) -> float:
    return 2.0 * first * second / (first + second) if first + second else 0.0


def adjusted_rand_index(first: Int, second: Int) -> float:
    """Agreement of two labelings (n,) of the same things (Hubert and Arabie, 1985).

    1 means equal groups, whatever the labels; 0 is the value of random labels. In the degenerate
    cases (fewer than two things, all things apart in both, all things together in both) it is 1.
    """
    first = numbers(first, "labels")
    second = numbers(second, "labels")
    if first.ndim != 1 or first.shape != second.shape:
        raise InputError(f"labels {first.shape} and {second.shape}: expected (n,) of both")
    together, in_first, in_second = map(_pairs, (np.column_stack([first, second]), first, second))
    everything = _pairs(np.zeros(len(first)))
    expected = in_first * in_second / everything if everything else 0.0
    room = 0.5 * (in_first + in_second) - expected
    return float((together - expected) / room) if room else 1.0


def _pairs(labels: Int | Float) -> float:
    """Number of pairs of things with the same label, which may be a row."""
    sizes = np.unique(labels, axis=0, return_counts=True)[1].astype(np.float64)
    return float((0.5 * sizes * (sizes - 1.0)).sum())


@dataclass(frozen=True, slots=True)
class BuildingCount(Report):
    """Buildings of a run.

    Args:
        buildings: Objects of the world, where those that touch count as one.
        seen_on_all_sides: Those of which every wall has a visible part.
        whole: Those of the latter that are one object of the map with exactly one segment for
            each wall of the building ("each building is represented with four
            line segments", section 4 of Teslić et al.).
    """

    buildings: int
    seen_on_all_sides: int
    whole: int


def buildings_seen(run: Run) -> BuildingCount:
    """Count the buildings of a run that were seen on all sides, and those mapped whole."""
    expect(run, Run, "run")
    objects = joined_objects(run.world)
    walls_of = np.bincount(objects)
    parts, walls = visible_walls(run)
    seen = (np.bincount(objects[walls], minlength=len(walls_of)) == walls_of) & (walls_of > 0)
    _, object_of, sizes = np.unique(run.map.objects, return_inverse=True, return_counts=True)
    pairs = match_segments(run.map.segments, parts)
    both = np.column_stack([objects[walls[pairs[:, 1]]], object_of[pairs[:, 0]]])
    (building, found), matched = (each.T for each in np.unique(both, axis=0, return_counts=True))
    whole = seen[building] & (matched == walls_of[building]) & (matched == sizes[found])
    return BuildingCount(
        buildings=int((walls_of > 0).sum()),
        seen_on_all_sides=int(seen.sum()),
        whole=int(whole.sum()),
    )


def summarise(run: Run) -> dict[str, Any]:
    """The figures of a run; those of the map are None if the mapper makes no LineMap."""
    judged = judged_part(run)
    # A row at a time, for a run may be larger than the memory.
    returned = sum(int(np.isfinite(ranges).sum()) for ranges in run.ranges)
    summary: dict[str, Any] = {
        "world": {
            "name": run.world.name,
            "objects": run.world.object_count,
            "walls": len(run.world.segments),
        },
        "drive": {
            "scans": len(run),
            "duration_s": run.trajectory.duration,
            "length_m": run.trajectory.length,
        },
        "laser": {
            "beams": run.ranges.shape[1],
            "range_max_m": run.lrf.range_max,
            "returned": returned,
            "returned_share": returned / run.ranges.size,
        },
        **dict.fromkeys(("map", "score", "buildings")),
    }
    if len(judged) < len(run):
        summary["judged_scans"] = len(judged)
    if run.maps:
        summary["map"] = {"segments": len(run.map), "objects": run.map.object_count}
        summary["score"] = score_run(judged).as_dict()
        summary["buildings"] = buildings_seen(judged).as_dict()
    return {**summary, "seen_share": seen_share(judged)}


def judged_part(run: Run) -> Run:
    """The run, or a sample of the scans of a long one."""
    if len(run) <= MOST_JUDGED:
        return run
    scans = np.random.default_rng(0).choice(len(run), MOST_JUDGED, replace=False)
    return run.part(np.sort(scans))


def drawn_part(run: Run) -> Run:
    """The run, or the beginning of a long one, with the final map."""
    most_drawn = 4000  # Largest number of scans in a picture: the first ones of a longer run.
    return run if len(run) <= most_drawn else run.part(np.arange(most_drawn))
