"""Sessions: a recorded drive on a map that is known, from an earlier drive or from a plan.

A map and a log enter. The poses of the log on the map leave, without a first guess.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError, shown
from lrf3d.base.interrupts import Progress, check, silent, stoppable
from lrf3d.geometry.lines import Bool, Float, Records
from lrf3d.geometry.pose import bent, between, compose
from lrf3d.matching.likelihood import some
from lrf3d.recordings import LaserLog, load_run
from lrf3d.recordings.reading import is_run
from lrf3d.recordings.repair.repairs import LOCALISING, repair
from lrf3d.simulation.run import Run
from lrf3d.slam.motion import size_of
from lrf3d.slam.offline import read
from lrf3d.slam.places.known_places import KnownPlaces
from lrf3d.slam.places.place_search import PlaceSearch
from lrf3d.slam.slam import Tracker
from lrf3d.world import World, load_world

# A robot was carried if it is found farther than this [m] from where its steps lead.
CARRIED = 1.0

# Share of the step that is added to that distance, as odometry drifts.
CARRIED_SHARE = 0.1

# A robot was carried if it is found turned by more than this [rad] from where its steps lead.
CARRIED_TURN = 0.5

# Number of scans by which the scale of a map is estimated.
SCALE_SCANS = 30


@dataclass(frozen=True, slots=True)
class Stretch:
    """Scans, from first to last, whose poses on the map are known with this probability.

    The robot was ``carried`` there if its steps do not lead there from the stretch before.
    """

    first: int
    last: int
    probability: float
    carried: bool


@dataclass(frozen=True, eq=False, repr=False)
class LocalisedLog:
    """A log on a known map: poses (k, 3) of the robot at its scans, NaN where they are not known.

    Each of the stretches is a part of the drive whose place is known. ``probability`` is that of
    the best hypothesis after the last scan. The map is ``map_scale`` times larger than what the
    scans show; 1 if the two agree within 2 %.
    """

    log: LaserLog
    poses: Float
    stretches: tuple[Stretch, ...]
    probability: float
    map_scale: float = 1.0

    def __repr__(self) -> str:
        return f"LocalisedLog({self.log.name}, {int(self.known.sum())} of {len(self.poses)} scans)"

    @property
    def known(self) -> Bool:
        """Which of the poses (k,) are known."""
        return np.isfinite(self.poses[:, 0])

    def summary(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        parts = [
            {"scans": [each.first, each.last], "probability": each.probability,
             "carried": each.carried, "first_pose": self.poses[each.first].tolist(),
             "last_pose": self.poses[each.last].tolist()}
            for each in self.stretches
        ]  # fmt: skip
        found = {
            "scans_localised": int(self.known.sum()),
            "probability": self.probability,
            "map_scale": self.map_scale,
        }
        return {"name": self.log.name, "log": self.log.counts, **found, "stretches": parts}


@stoppable()
def localise_log(
    known: Run | World | KnownPlaces | str | Path,
    log: LaserLog | str | Path,
    *,
    without_repairs: Sequence[str] = (),
    progress: Progress = silent,
) -> LocalisedLog:
    """Find where a recorded drive was on a known map, without a first pose.

    Args:
        known: The map: a run, such as that of `slam_log`, a world, or the path of either.
        log: The log, or its path; the poses in it are odometry.
        without_repairs: Names of the `REPAIRS` of logs that are left out, as for `map_log`.
        progress: Called with the number of finished scans, and of all.

    Raises:
        InputError: The map or the log cannot be used.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1 + 0.2 * k, 1, 0) for k in range(20)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> found = lrf3d.localise_log(room, "drive.log")
        >>> found, (found.poses[-1].round(1) + 0.0).tolist()
        (LocalisedLog(drive, 20 of 20 scans), [4.8, 1.0, 0.0])
    """
    places = known if isinstance(known, KnownPlaces) else known_places(known)
    log = read(log, "odometry", without_repairs)
    [recording] = repair(log, LOCALISING, without_repairs)
    log = replace(
        recording.log,
        scans=recording.scans,
        notes=(*recording.log.notes, *recording.sentences),
    )
    tracker = Tracker(laser_offset=log.odometry.laser_offset)
    search = PlaceSearch(places)
    for number, (scan, step) in enumerate(zip(log.scans, recording.increments, strict=True)):
        _, seen, _ = tracker.track(scan, step)
        search.see(number, seen, tracker.tracked[-1].pose)
        progress(number + 1, len(log))
        check()
    search.search()
    front = np.array([tracked.pose for tracked in tracker.tracked])
    poses = np.full((len(log), 3), np.nan)
    parts: list[Stretch] = []
    placed: dict[int, Float] = {}
    for found in search.found:
        first = parts[-1].last + 1 if parts else 0
        path = {k: pose for k, pose in sorted(found.path.items()) if k >= first}
        if not path:
            continue
        placed.update(path)
        begin = min(path)
        part = slice(begin, found.last + 1)
        poses[part] = bent(front[part], np.array([*path]) - begin, np.array([*path.values()]))
        carried = bool(parts) and _is_carried(front, poses, parts[-1].last, begin)
        parts.append(Stretch(begin, found.last, found.probability, carried))
    return LocalisedLog(
        log, poses, tuple(parts), search.probability, _map_scale(places, placed, search.hits)
    )


def _map_scale(
    places: KnownPlaces, placed: Mapping[int, Float], hits: Mapping[int, Records]
) -> float:
    """How many times larger a map is than what scans show, by their poses on it and their hits."""
    if not placed:
        return 1.0
    numbers = some(np.array([*placed]), SCALE_SCANS)
    return places.scale(np.array([placed[k] for k in numbers]), [hits[k] for k in numbers])


def _is_carried(front: Float, poses: Float, last: int, begin: int) -> bool:
    """Whether the robot was carried between two scans; if not, it drove off the map for a while.

    ``front`` (k, 3) is where its steps lead, ``poses`` (k, 3) where it was found.
    """
    step = between(front[last], front[begin])
    distance, turn = size_of(between(compose(poses[last], step), poses[begin]))
    return distance > CARRIED + CARRIED_SHARE * size_of(step)[0] or turn > CARRIED_TURN


def known_places(known: Run | World | str | Path) -> KnownPlaces:
    """The places of a map: a run, a world, or the path of either."""
    if isinstance(known, str | Path):
        known = load_run(known) if is_run(str(known)) else load_world(known)
    if isinstance(known, Run):
        return KnownPlaces.from_run(known)
    if isinstance(known, World):
        return KnownPlaces.from_world(known)
    raise InputError(f"map {shown(known)}: expected a run, a world, or the path of either")
