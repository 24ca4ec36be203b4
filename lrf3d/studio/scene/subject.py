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
    telling_beams,
)
from lrf3d.studio.scene.shown import Shown
from lrf3d.studio.scene.stage.structures import turning_walls, walls_of
from lrf3d.studio.scene.timeline import FIRST, Moment, metres

# Time for which the title stands [s of the film].
TITLE_TIME = 1.9

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
    # When that is over [s of the run], and what is said then.
    until: float = np.inf
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
    then: str = "What its laser has seen is lit"
    # How it opens and ends: a key of the stagings of stories; those of the world if not given.
    staging: str = ""
    # What the camera looks at past the robot as it opens (2,), in the world [m]; what the first
    # scan has met farthest away if it is not given.
    faces: Float | None = None
    # What the end turns about, under pins (n, 2), in the world [m].
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
    return beams


# Up to eight runs may be side by side.
@lru_cache(8)
def subject_of(run: Shown, playback: float) -> Subject:
    """The first that a run has of a closed loop, a false room, other robots, glass, reflectors."""
    # What the first scan shows is shown by the opening.
    since = float(run.trajectory.times.min()) + FIRST * playback
    found = _loop(run) or _false_room(run, since) or _robots(run, since)
    found = found or _glass(run) or _reflectors(run, since) or _false_wall(run, since)
    usual = "A robot maps what it has never seen" if len(run.maps) else "What a laser sees"
    if found or run.knows_truth:
        return found or Subject(usual)
    return Subject(f"A file of {distances(run)} becomes a map", staging="record")


def _loop(run: Shown) -> Subject | None:
    """The loop round which odometry alone is seen to drift."""
    drift = drift_of(run)
    if drift is None or drift.loop is None:
        return None
    first, last = drift.loop
    begins, closes = run.trajectory.times[[first, last]].tolist()
    path = drift.believed.poses[first : last + 1, :2]
    length = np.hypot(*np.diff(path, axis=0).T).sum()
    return Subject(
        "Odometry drifts; the laser finds the way back",
        closes,
        places=np.array([path.min(axis=0) - _PAST_LOOP, path.max(axis=0) + _PAST_LOOP]),
        proof="Red: where odometry alone puts it",
        since=begins,
        seen="above",
        until=closes,
        after=f"Back after {metres(length)}: red shows the drift",
        found=f"{metres(drift.off(run.trajectory.times[-1]))} of drift removed",
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
        found=f"{counted(len(mirrors), 'mirror')} found, {kept}",
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
    # Where that robot comes from, and goes to.
    there = others[nearest].at(times[scan] + _AROUND)[:, :2]
    entered = float(times[-1])
    return Subject(
        "To a laser, another robot is a wall",
        entered,
        places=np.vstack([_nearest(run, scans[first], false[first]), there]),
        proof=f"Here {{0}} sees {{{1 + nearest}}}",
        until=entered,
        after="Red: a robot taken for a wall",
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
    at_first = shapely.points(run.trajectory.poses[0, :2]), panes_of(run.world)
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
        faces=shapely.get_coordinates(shapely.shortest_line(*at_first))[1],
        pinned=panes,
    )


def _middles_of(run: Shown, kind: str) -> Float:
    """The middles (n, 2) of the segments of a kind in the last map."""
    if not len(run.maps):
        return np.zeros((0, 2))
    last = run.maps[len(run.maps) - 1]
    chosen = last.segments[last.kinds == kind]
    return np.asarray(chosen.reshape(-1, 2, 2).mean(axis=1))


def _reflectors(run: Shown, since: float) -> Subject | None:
    """The scan that sees the most reflectors after a time [s], much brighter than all else."""
    bright = np.flatnonzero(walls_of(run.world, lambda material: material.retro > 1.0))
    if not len(bright):
        return None
    times = run.trajectory.times
    late = np.flatnonzero((times > since) & (times < EARLY * times.max())).tolist()
    late = late[:: 1 + len(late) // _COMPARED]
    seen = [met_reflectors(run, number) for number in late]
    counts = [len(each) for each in seen]
    if not any(counts):
        return None
    most = int(np.argmax(counts))
    scan = run.scans_at(late[most])[0]
    if scan.intensities is None:
        return None
    light = scan.intensities[scan.hits]
    brighter = np.median(light[seen[most]]) / np.median(np.delete(light, seen[most]))
    words = f"Reflectors: {brighter:.0f} × as bright as walls"
    met = np.unique(np.concatenate([run.scans_at(number)[0].walls for number in range(len(times))]))
    known = bright[np.isin(bright, met)]
    return Subject(
        "To a laser, reflectors outshine all else",
        float(times[late[most]]),
        _nearest(run, late[most], scan.points()[seen[most]]),
        words,
        found=f"{len(known)} of {len(bright)} reflectors met, {brighter:.0f} × as bright as walls",
        told=True,
        staging="reflectors",
        pinned=run.world.segments[known].reshape(-1, 2, 2).mean(axis=1),
    )


def _false_wall(run: Shown, since: float) -> Subject | None:
    """The map that drops false walls for good after a time [s], with the robot near them."""
    scans, false, _ = _false_walls(run, since)
    later = np.zeros((0, 2))
    gone = list[Float]()
    for places in reversed(false):
        gone.insert(
            0, places[~shapely.dwithin(shapely.points(places), shapely.multipoints(later), _TAKEN)]
        )
        later = np.concatenate([later, places])
    dropping = [number for number, places in enumerate(gone[:-1]) if len(places)]
    if not dropping:
        return None
    places = run.trajectory.poses[scans[1:], :2]
    away = [
        shapely.distance(shapely.multipoints(gone[k]), shapely.points(places[k])) for k in dropping
    ]
    best = dropping[int(np.argmin(away))]
    known = float(run.trajectory.times[scans[best + 1]])
    return Subject(
        "False walls enter a map, and leave it again",
        known,
        places=gone[best],
        proof="Red: in the map, but no wall is there",
        until=known,
        after="Beams go through, so the map drops it",
        then="" if run.obstacles else "From afar, a gap looks like a wall",
        found="" if len(false[-1]) else "All false walls are gone again",
        pinned=np.array([gone[k].mean(axis=0) for k in dropping]),
        dropped=gone[best],
    )
