"""What a film is about: one sentence, and the moment of the run that proves it.

A run enters; what is said and what is to be in the picture leave.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from lrf3d.base.latest import Latest
from lrf3d.geometry.lines import Float
from lrf3d.studio.scene.drift import Drift
from lrf3d.studio.scene.glass import counts_at_glass
from lrf3d.studio.scene.marks import FALSE_FROM, DrawnMap
from lrf3d.studio.scene.shown import Shown
from lrf3d.studio.scene.stage.structures import Structures
from lrf3d.studio.scene.timeline import FIRST

# Time for which the title stands [s of the film].
TITLE_TIME = 3.0

# Number of map snapshots that are searched for false rooms, at most.
_COMPARED = 120

# Share of the false pieces, or of the hits at glass, that the picture shows: the nearest.
_NEAR = 0.8


class Subject(NamedTuple):
    """What a film is about."""

    # The sentence that the film begins with.
    title: str
    # The time that proves it [s of the run]; None if no single moment does.
    moment: float | None = None
    # What is to be seen there besides the robot (n, 2), in the world [m].
    places: Float = np.zeros((0, 2))
    # What is said of it.
    proof: str = ""
    # When that is over [s of the run], and what is said then.
    until: float = np.inf
    after: str = ""
    # Where a mirror makes a laser see a wall (2,), in the world [m].
    aim: Float | None = None

    def aim_at(self, time: float) -> Float | None:
        """That place, as long as the map holds the wall."""
        return self.aim if time < self.until else None


# The subjects of the runs that were asked for last: up to eight may be side by side.
_FOUND = Latest(8)


def subject_of(run: Shown, playback: float) -> Subject:
    """The first that a run has of a closed loop, a false room, glass, and other robots."""
    return _FOUND.of((run, playback), partial(_subject, run, playback))


def _subject(run: Shown, playback: float) -> Subject:
    # What the first scan shows is shown by the opening.
    since = float(run.trajectory.times.min()) + FIRST * playback
    found = _loop(run, playback) or _false_room(run, since) or _glass(run) or _fleet(run)
    usual = "A robot maps what it has never seen" if len(run.maps) else "What a laser sees"
    return found or Subject(usual if run.knows_truth else "A recorded drive, mapped by its laser")


def _loop(run: Shown, playback: float) -> Subject | None:
    """The loop that removes the most drift."""
    drift = Drift.of(run, np.zeros(2), playback)
    if drift is None or not len(drift.times):
        return None
    most = int(np.argmax(drift.removed))
    closes = float(run.trajectory.times.min() + drift.times[most])
    title = "Odometry drifts; the laser finds the way back"
    places = drift.jumps[most].reshape(2, 2)
    return Subject(title, closes, places, "Pale: where odometry alone would be", closes)


def _false_room(run: Shown, since: float) -> Subject | None:
    """The last map that holds half of what a mirror has added to it since a time [s]."""
    materials = filter(None, run.world.materials)
    mirrors = any(one.mirrors and not one.passes for one in materials)
    if not (mirrors and run.knows_truth and len(run.maps)):
        return None
    structures = Structures.from_run(run)
    times = run.trajectory.times
    first = run.snapshot_after(int(np.searchsorted(times, since)))
    compared = np.linspace(max(first, 0), len(run.maps) - 1, _COMPARED).astype(int)
    numbers = np.unique(compared).tolist()
    frame = np.tile(structures.origin, 2)
    false = [
        DrawnMap.plain(run.maps[number].segments - frame).ghosts(structures, FALSE_FROM).corners
        for number in numbers
    ]
    counts = np.array([len(corners) for corners in false])
    last = int(np.flatnonzero(2 * counts >= counts.max())[-1])
    if not counts[last]:
        return None
    held = sum(run.snapshot_after(scan) <= numbers[last] for scan in range(len(times)))
    known = float(times[held - 1])
    title = "In a mirror, a laser sees a false room"
    places = false[last].reshape(-1, 3)[:, :2] + structures.origin
    near = _nearest(run, held - 1, places)
    aim = near[np.argmin(np.hypot(*(near - near.mean(axis=0)).T))]
    knows = "mirror" in run.maps[min(numbers[last] + 1, len(run.maps) - 1)].kinds
    after = "The same room, mirrored: so this is a mirror" * knows
    return Subject(title, known, near, "The red room is only a reflection", known, after, aim)


def _nearest(run: Shown, scan: int, places: Float) -> Float:
    """Places (n, 2) but for the farthest from the robot at a scan."""
    away = np.hypot(*(places - run.trajectory.poses[scan, :2]).T)
    return np.asarray(places[away <= np.quantile(away, _NEAR)])


def _glass(run: Shown) -> Subject | None:
    """The scan of which the most beams come back from glass."""
    counts = counts_at_glass(run)
    if not 0 < counts.back < counts.through:
        return None
    return Subject(
        "Glass lets most of a laser's beams through",
        float(run.trajectory.times[counts.scan]),
        _nearest(run, counts.scan, counts.ends),
        "Blue went through the pane, red came back",
    )


def _fleet(run: Shown) -> Subject | None:
    """Other robots: the shots show them by turns."""
    count = 1 + sum(each.is_robot for each in run.obstacles)
    if count == 1:
        return None
    return Subject(f"{'Two' if count == 2 else count} robots drive; each maps what it sees")
