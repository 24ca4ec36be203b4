"""What a film is about: one sentence, and the moment of the run that proves it.

A run enters; what is said and what is to be in the picture leave.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely

from lrf3d.base.text import counted
from lrf3d.geometry.lines import LEFT, Float, Int
from lrf3d.mapping.line_map import GLASS, MIRROR
from lrf3d.studio.scene.drift import drift_of
from lrf3d.studio.scene.found import distances, false_walls
from lrf3d.studio.scene.glass import (
    EARLY,
    TellingBeams,
    beams_through,
    counts_at_glass,
    met_reflectors,
    panes_of,
    reflectors_of,
    telling_beams,
)
from lrf3d.studio.scene.look import TINY
from lrf3d.studio.scene.shown import Shown
from lrf3d.studio.scene.stage.structures import turning_walls
from lrf3d.studio.scene.timeline import FIRST, Moment, metres

# Largest distance of the end of a wall from the middle of a gap [m].
_GAP = 1.5

# Cosine of the angle from which on two such ends are on opposite sides.
_OPPOSITE = -0.9

# Time for which the title stands [s of the film].
TITLE_TIME = 1.9

# What is said after the title where no moment is proven.
_USUALLY = "What its laser has seen is lit"

# Number of maps or scans that are searched, at most.
_COMPARED = 120

# Distance from a false wall up to which a robot that passes may have been taken for it [m].
_TAKEN = 0.5

# Times around the moment at which a robot sees another [s].
_AROUND = np.array([-1.0, 0.0, 1.0])

# Shots that show the whole on the way to the end.
_FROM_AFAR = ("rise", "whole")

# Share of the pieces of false walls that the picture shows: the nearest.
_NEAR = 0.8

# Least drift in the end that counts as removed, in the length of the path.
_LEAST_OFF = 0.01

# Largest error of the estimate then, in that of odometry alone.
_CLEARLY = 0.5

# How far the picture of a loop reaches past its path [m].
_PAST_LOOP = 3.5


class Subject(NamedTuple):
    """What a film is about."""

    # The sentence that the film begins with.
    title: str
    # The time that proves it [s of the run]; None if no single moment does.
    moment: float | None = None
    # What is to be seen there besides the robot (n, 2), in the world [m].
    places: Float = np.zeros((0, 2))
    # What is said of it, with the robots that it names by their numbers.
    proof: str = ""
    # From when on that is seen, fast [s of the run], if it is more than a moment.
    since: float | None = None
    # When that is over [s of the run].
    until: float = np.inf
    # What is said from then on.
    after: str = ""
    # Where a mirror makes a laser see a wall (2,), in the world [m].
    aim: Float | None = None
    # What of it is found in the end.
    found: str = ""
    # Whether the beams that tell it are drawn, and counted.
    told: bool = False
    # How it is seen: a key of the proofs of stories.
    seen: str = "round"
    # The direction from which sides are counted [rad]: that of a pane, with the robot on its right.
    along: float = 0.0
    # From when on the map beside the picture magnifies it [s], and the width of what it shows [m].
    magnified: tuple[float, ...] = ()
    # What is said after the title.
    then: str = ""
    # How it opens and ends: a key of the stagings of stories; the usual one of the world if empty.
    staging: str = ""
    # What the camera looks at past the robot as it opens (2,), in the world [m]; what the first
    # scan has met farthest away if it is not given.
    faces: Float | None = None
    # Where pins point in the end, to which the camera turns (n, 2), in the world [m].
    pinned: Float = np.zeros((0, 2))
    # Where the map drops a false wall (n, 2), in the world [m]: beams go through there.
    dropped: Float = np.zeros((0, 2))

    def aim_at(self, time: float) -> Float | None:
        """That place, as long as the map holds the wall."""
        return self.aim if time < self.until else None


def beams_told(run: Shown, moment: Moment, playback: float, shot: str) -> list[TellingBeams]:
    """The beams of a moment that tell the subject; as the map is completed they would hide it."""
    subject = subject_of(run, playback)
    told = moment.scanning and shot not in _FROM_AFAR and subject.told
    beams = [*telling_beams(run, moment.scan)] if told else []
    if moment.scanning and shot == "proof" and len(subject.dropped):
        beams.append(beams_through(run, moment.scan, subject.dropped))
    return [each for each in beams if len(each.ends)]


# Up to eight runs may be side by side.
@lru_cache(8)
def subject_of(run: Shown, playback: float) -> Subject:
    """The first that a run has: a loop, a false room, other robots, glass, reflectors, false walls.

    Without any of these, it is the map.
    """
    # What the first scan shows is shown by the opening.
    since = float(run.trajectory.times.min()) + FIRST * playback
    found = _loop(run) or _false_room(run, since) or _robots(run, since)
    found = found or _glass(run) or _reflectors(run, since) or _false_wall(run, since)
    usual = "A robot maps what it has never seen" if len(run.maps) else "What a laser sees"
    if found or run.knows_truth:
        return found or Subject(usual, then=_USUALLY)
    return Subject(f"A file of {distances(run)} becomes a map", then=_USUALLY, staging="record")


def _loop(run: Shown) -> Subject | None:
    """The loop round which odometry alone is seen to drift."""
    drift = drift_of(run)
    if drift is None or drift.loop is None:
        return None
    first, last = drift.loop
    begins, closes = run.trajectory.times[[first, last]].tolist()
    path = drift.believed.poses[first : last + 1, :2]
    steps = np.hypot(*np.diff(drift.believed.poses[:, :2], axis=0).T)
    last_time = run.trajectory.times[-1]
    off = drift.off(last_time)
    ghost, robot = np.hypot(*(drift.ends(last_time) - run.trajectory.poses[-1])[:, :2].T)
    removed = off > _LEAST_OFF * steps.sum() and (robot < _CLEARLY * ghost or not run.knows_truth)
    return Subject(
        "Odometry drifts; the laser finds the way back",
        closes,
        places=np.array([path.min(axis=0) - _PAST_LOOP, path.max(axis=0) + _PAST_LOOP]),
        proof="Red: where odometry alone puts it",
        since=begins,
        seen="above",
        until=closes,
        after=f"Back after {metres(steps[first:last].sum())}: red shows the drift",
        found=f"{metres(off)} of drift removed" * bool(removed),
        magnified=(begins, drift.magnified) * bool(drift.magnified),
        staging="record",
    )


def _false_room(run: Shown, since: float) -> Subject | None:
    """The last map that holds half of what a mirror has added to it since a time [s]."""
    if not turning_walls(run.world).any():
        return None
    scans, false, held = _false_walls(run, since)
    if not len(held):
        return None
    last = held[-1]
    left = np.append(scans, len(run.trajectory.times))[last + 1] - 1
    # Until the next map.
    known, until = run.trajectory.times[[left, min(left + 1, len(run.trajectory.times) - 1)]]
    near = _nearest(run, left, false[last])
    mirrors = _middles_of(run, MIRROR)
    aim = near[np.argmin(np.hypot(*(near - near.mean(axis=0)).T))]
    kept = "a false room is left" if len(false[-1]) else "no false room is left"
    return Subject(
        "In a mirror, a laser sees a false room",
        float(known),
        places=near,
        proof="The red room is only a reflection",
        until=float(until),
        after="The same room, mirrored: so this is a mirror" * bool(len(mirrors)),
        aim=aim,
        found=f"{counted(len(mirrors), 'mirror') if len(mirrors) else 'No mirror'} found, {kept}",
        staging="mirror",
        faces=aim,
        pinned=mirrors,
    )


def _robots(run: Shown, since: float) -> Subject | None:
    """Other robots, and the first map after a time [s] that takes one of them for a wall."""
    others = [each.path for each in run.obstacles if each.is_robot]
    if not others:
        return None
    count = "Two" if len(others) == 1 else 1 + len(others)
    at_first = others[0].at(run.trajectory.times[:1])[0, :2]
    apart = Subject(
        f"{count} robots map apart; together they find more", staging="robots", faces=at_first
    )
    scans, false, held = _false_walls(run, since)
    if not len(held):
        return apart
    first = held[0]
    times = run.trajectory.times[: scans[first] + 1]
    paths = shapely.points([path.at(times)[:, :2] for path in others])
    away = shapely.distance(paths, shapely.multipoints(false[first]))
    if away.min() > _TAKEN:
        return apart
    nearest, scan = np.unravel_index(np.argmin(away), away.shape)
    aside = shapely.distance(shapely.points(false[first])[:, None], paths.ravel()).min(axis=1)
    mixed = aside.max() > _TAKEN
    # Where that robot comes from, and goes to.
    there = others[nearest].at(times[scan] + _AROUND)[:, :2]
    entered = float(times[-1])
    return Subject(
        "To a laser, another robot is a wall",
        entered,
        places=np.vstack([_nearest(run, scans[first], false[first]), there]),
        proof=f"Here {{0}} sees {{{1 + nearest}}}",
        until=entered,
        after="Red: false walls; one is a robot" if mixed else "Red: a robot taken for a wall",
        told=True,
        staging="robots",
        faces=at_first,
    )


def _false_walls(run: Shown, since: float) -> tuple[Int, list[Float], Int]:
    """The first scans (m,) with the maps since a time [s], and where they have false walls (n, 2).

    Third, which of the maps have at least half as many as any. None without the truth.
    """
    times = run.trajectory.times
    first = run.snapshot_after(int(np.searchsorted(times, since)))
    compared = np.linspace(max(first, 0), len(run.maps) - 1, _COMPARED).astype(int)
    numbers = np.unique(compared) if run.knows_truth and len(run.maps) else compared[:0]
    found = [false_walls(run, number)[1] for number in numbers.tolist()]
    most = max([1, *(len(places) for places in found)])
    scans = np.searchsorted([run.snapshot_after(scan) for scan in range(len(times))], numbers)
    return scans, found, np.flatnonzero([2 * len(places) >= most for places in found])


def _nearest(run: Shown, scan: int, places: Float) -> Float:
    """Places (n, 2) but for the farthest from the robot at a scan."""
    away = np.hypot(*(places - run.trajectory.poses[scan, :2]).T)
    return np.asarray(places[away <= np.quantile(away, _NEAR)])


def _glass(run: Shown) -> Subject | None:
    """The scan of which the most beams meet glass, and some come back from it."""
    counts = counts_at_glass(run)
    if not 0 < counts.back < counts.through:
        return None
    # The pane is seen from the robot's side, and beyond it as much as before it.
    start, end = counts.pane.reshape(2, 2)
    across = (end - start) / np.hypot(*(end - start)) @ LEFT
    robot = run.trajectory.poses[counts.scan, :2]
    before = (robot - start) @ across * across
    along = float(np.arctan2(*(before @ LEFT)[::-1]))
    sight = shapely.shortest_line(shapely.points(run.trajectory.poses[0, :2]), panes_of(run.world))
    panes = _middles_of(run, GLASS)
    known = (
        f"{counted(len(panes), 'pane')} found, tinted" if len(panes) else "none is known as glass"
    )
    share = 100.0 * counts.through / (counts.through + counts.back)
    return Subject(
        "Glass lets most of a laser's beams through",
        float(run.trajectory.times[counts.scan]),
        np.array([robot - 2.0 * before]),
        "Blue goes through the pane, white comes back",
        found=f"{known}  ·  {share:.0f} % of the beams at glass went through",
        told=True,
        seen="aside",
        along=along,
        then="Of slanted beams, few come back",
        staging="pane",
        faces=shapely.get_coordinates(sight)[1],
        pinned=panes,
    )


def _middles_of(run: Shown, kind: str) -> Float:
    """The middles (n, 2) of the segments of a kind in the last map."""
    if not len(run.maps):
        return np.zeros((0, 2))
    last = run.maps[-1]
    chosen = last.segments[last.kinds == kind]
    return np.asarray(chosen.reshape(-1, 2, 2).mean(axis=1))


def _reflectors(run: Shown, since: float) -> Subject | None:
    """The scan that sees the most reflectors after a time [s], much brighter than all else."""
    reflectors = reflectors_of(run.world)
    count = 1 + int(reflectors.max())
    if not count:
        return None
    times = run.trajectory.times
    late = np.flatnonzero((times > since) & (times < EARLY * times.max())).tolist()
    late = late[:: 1 + len(late) // _COMPARED]
    seen = [met_reflectors(run, number) for number in late]
    counts = list(map(len, seen))
    if not any(counts):
        return None
    most = int(np.argmax(counts))
    scan = run.scans_at(late[most])[0]
    if scan.intensities is None:
        return None
    light = scan.intensities[scan.hits]
    others = reflectors[scan.walls[scan.hits]] < 0
    if not others.any():
        return None
    brighter = np.median(light[seen[most]]) / np.median(light[others])
    walls = [each.walls for number in range(len(times)) for each in run.scans_at(number)]
    met = np.unique(reflectors[np.concatenate(walls)])
    met = met[met >= 0]
    middles = run.world.segments.reshape(-1, 2, 2).mean(axis=1)
    share = f"{len(met)} of {counted(count, 'reflector')} met"
    return Subject(
        "To a laser, reflectors outshine all else",
        float(times[late[most]]),
        _nearest(run, late[most], scan.points()[seen[most]]),
        f"Reflectors: {brighter:.0f} × as bright as walls",
        found=f"{share}, {brighter:.0f} × as bright as walls",
        told=True,
        staging="reflectors",
        pinned=np.array([middles[reflectors[:-1] == each].mean(axis=0) for each in met]),
    )


def _false_wall(run: Shown, since: float) -> Subject | None:
    """The map that drops a false wall for good after a time [s], with the robot near it."""
    times = run.trajectory.times
    scans, false, _ = _false_walls(run, since)
    # What is left in the end contradicts the story.
    if not len(scans) or len(false[-1]):
        return None
    later = np.zeros((0, 2))
    dropped = list[tuple[int, Float]]()
    for scan, places in [*zip(scans[1:].tolist(), false[:-1], strict=True)][::-1]:
        gone = ~shapely.dwithin(shapely.points(places), shapely.multipoints(later), _TAKEN)
        dropped += [(scan, wall) for wall in _apart(places[gone])]
        later = np.concatenate([later, places])
    early = [(scan, wall) for scan, wall in dropped if times[scan] < EARLY * times.max()]
    if not early:
        return None
    away = [np.hypot(*(wall - run.trajectory.poses[k, :2]).T).min() for k, wall in early]
    scan, wall = early[int(np.argmin(away))]
    return Subject(
        "False walls enter a map, and leave it again",
        float(times[scan]),
        places=wall,
        proof=f"Red: {_no_wall(run, wall)}",
        until=float(times[scan]),
        after="Beams go through, so the map drops it",
        found="All false walls are gone again",
        pinned=np.array([wall.mean(axis=0) for _, wall in dropped]),
        dropped=wall,
    )


def _no_wall(run: Shown, wall: Float) -> str:
    """What is where the map has a false wall (n, 2): a gap, where walls end on opposite sides."""
    ends = run.world.segments.reshape(-1, 2) - wall.mean(axis=0)
    away = np.hypot(*ends.T)
    sides = (ends / np.maximum(away, TINY)[:, None])[away < _GAP]
    if (sides @ sides.T).min(initial=0.0) < _OPPOSITE and not run.obstacles:
        return "a gap that looked like a wall from afar"
    return "in the map, but no wall is there"


def _apart(places: Float) -> list[Float]:
    """Places (n, 2) in groups, one for each false wall: those of a group are close together."""
    points = shapely.points(places)
    walls = shapely.get_parts(shapely.buffer(shapely.multipoints(points), _TAKEN))
    return [places[shapely.intersects(wall, points)] for wall in walls if not wall.is_empty]
