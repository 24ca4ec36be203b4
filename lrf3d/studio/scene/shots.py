"""The shots of a film: which parts of a run it shows, chosen by how much happens there.

A film takes about fifteen seconds, however long the run is. It opens as the light of the first scan
spreads in the dark; then it shows the parts of the run in which most happens and, in slow motion,
what it is about. It ends on a turn about the whole world, in which the rest of the run
completes the map in fast motion. A short run is shown without gaps.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from lrf3d.geometry.lines import Float, lengths
from lrf3d.studio.scene.subject import subject_of
from lrf3d.studio.scene.timeline import FIRST, Timeline

# Usual length of a film [s].
LENGTH = 15.0

# Shortest film that may be asked for [s].
SHORTEST = 4.0

# Longest film that may be asked for [s].
LONGEST = 3600.0

# Age of the light of the first scan as a film begins [s of the film]: it is around the robot.
OPENING = 0.3

# Largest share of a short run for which the first scan is shown.
_FIRST_SHARE = 0.4

# Least share of that time that is left where a proof begins earlier.
_STILL = 0.5

# Time for which the camera rises to the whole world [s of the film].
RISE = 3.2

# Time for which it shows the whole world [s of the film].
CLOSING = 3.2

# Part of that in which the rest of the run completes the map [s of the film].
FILLING = 0.8

# Where a drift is removed, the opening is shorter by this time, and the end longer by twice as much
# [s of the film].
_ASTRAY = 1.2

# Approximate length of each other shot [s of the film].
_SHOT = 2.0

# Kinds of these shots, in turn: from the street, from a roof, and from straight above.
SHOTS = ("chase", "close", "above")

# The shot of the first scan.
FIRST_SHOT = "wave"

# The shot of what the film is about.
PROOF = "proof"

# How much longer that takes than others.
_SLOWER = 1.8

# How much of the run it shows, if it can [s of a film that is not slower].
_PROVEN = 0.8

# Share of that shot which comes before its moment.
_BEFORE = 0.45

# The same share where the shot before it has shown what comes before.
_CLOSED = 0.1

# Rounding of its moment [s].
_ROUNDING = 1e-6

# Largest share of a short run, after its first scan, that is shown before the camera rises.
_LATEST = 0.9

# Share of the run in which the shots are chosen, unless its moment comes later: the rest is seen
# from above.
_CHOSEN = 0.6

# Number of moments of a run at which it is rated how much happens.
_MOMENTS = 400

# Share of all changes of a map from which on it is as good as whole.
_MOST = 0.9

# Number of map snapshots that are compared; a long run has thousands.
_SNAPSHOTS = 120


class Shot(NamedTuple):
    """A part of a film."""

    # What it shows: a key of the captions.
    name: str
    # Its length [s of the film].
    length: float
    # From when to when it shows the run [s].
    start: float
    end: float


def plan_shots(timeline: Timeline, length: float = LENGTH) -> tuple[Shot, ...]:
    """The shots of a film of a length [s], in the order of the run; one proves what it is about."""
    playback = timeline.playback
    lasts = (timeline.end - timeline.start) / playback
    subject = subject_of(timeline.run, playback)
    astray = _ASTRAY * (subject.since is not None)
    fixed = FIRST - OPENING + RISE + CLOSING + astray
    # In a shorter film, the same shots are shorter.
    scale = min(1.0, (length + OPENING) / (fixed + OPENING + _SHOT))
    first = min(scale * (FIRST - astray), _FIRST_SHARE * lasts)
    # What the opening shows is proven by it; rounding neither loses the moment nor shows it twice.
    moment = subject.moment
    proven = -np.inf if moment is None else moment - _ROUNDING
    if proven > timeline.start + playback * first:
        # The proof begins before its moment, if the first scan is still seen.
        before = (proven - timeline.start) / playback - _BEFORE * _PROVEN
        if before >= _STILL * first:
            first = min(first, before)
    opened = timeline.start + playback * first
    longer = (_SLOWER - 1.0) * (proven > opened)
    # A proof of more than a moment takes its time from the rise and from what follows.
    faster = 1.0 + longer * (subject.since is not None)
    filling = scale * FILLING / faster
    rise = scale * RISE / faster
    free = max(length - fixed, scale * _SHOT) + scale * (FILLING + RISE) - filling - rise
    count = max(1, round(free / _SHOT - longer))
    each = free / (count + longer)
    # When the map is as good as whole, the rest is seen fast, from above.
    if length <= LENGTH and subject.since is None:
        needed = np.ceil((_settled(timeline) - opened) / (playback * each))
        count = max(1, min(count, int(needed)))
    closing = scale * (CLOSING - FILLING) + filling
    part = min(each, _PROVEN) if longer else each
    shown = (count - 1) * each + part + rise + filling
    if lasts <= first + shown:
        # The whole run is shown, at its playback speed; the shots reach the moment.
        left = lasts - first
        wished = (proven - opened) / playback + _ROUNDING
        # What comes too late is not waited for.
        reached = max(left * (1.0 - (rise + filling) / shown), wished * (wished <= _LATEST * left))
        each = part = reached / count
        share = (left - reached) / (rise + filling)
        rise, filling = share * rise, share * filling
        starts = first + each * np.arange(count)
    else:
        starts = _starts(timeline, first, each, count, proven if longer else None)
    starts = timeline.start + playback * starts
    proves = (starts < proven) & (proven <= starts + playback * each)
    ends = starts + playback * np.where(proves, part, each)
    others = np.array(SHOTS)[(np.cumsum(~proves) - 1) % len(SHOTS)]
    # What takes more than a moment is seen fast before that, in the time of a proof.
    ahead = np.append(proves[1:], False) & (subject.since is not None)
    ends = np.where(ahead, np.append(starts[1:], 0.0), ends)
    slow = np.where(subject.since is None, proves, ahead & (lasts > first + shown))
    names = np.where(proves | ahead, PROOF, others).tolist()
    takes = each * np.where(slow, _SLOWER, 1.0)
    begun = timeline.start + playback * min(OPENING, 0.5 * first)
    last = float(ends[-1])
    risen = last + (timeline.end - last) * rise / (rise + filling)
    # What the opening leaves goes to the end, too.
    turned = closing - filling + 2.0 * astray
    return (
        Shot("opening", (opened - begun) / playback, begun, opened),
        *map(Shot, names, takes.tolist(), starts.tolist(), ends.tolist()),
        Shot("rise", rise, last, risen),
        Shot("whole", filling, risen, timeline.end),
        Shot("end", turned, timeline.end, timeline.end + playback * turned),
    )


def _starts(
    timeline: Timeline, first: float, each: float, count: int, moment: float | None
) -> Float:
    """Start times (count,) of the shots of a length [s of the film] in which most happens.

    One is that of a moment [s], which has another one before it where more than that proves the
    subject, from a time on [s]. As many come before these as there is time for, up to all others.
    """
    grid = np.linspace(timeline.start, timeline.end, _MOMENTS)
    lasts = (timeline.end - timeline.start) / timeline.playback
    width = max(1, round(_MOMENTS * each / lasts))
    # How much happens in a shot that begins at each moment.
    happens = uniform_filter1d(_news(timeline, grid), width, origin=-(width // 2), mode="nearest")
    moments = (grid - timeline.start) / timeline.playback

    def chosen(number: int, low: float, high: float) -> list[float]:
        """When so many shots start that begin between two times [s of the film]."""
        # Each has the same part of the time that is left between them.
        left = np.linspace(low, max(high - each * (number - 1), low), number + 1)
        starts = list[float]()
        for place, (begin, end) in enumerate(pairwise(left)):
            begun = moments - each * place
            within = (begun >= begin) & (begun <= end)
            best = moments[np.argmax(np.where(within, happens, -1.0))]
            starts.append(max(best, begin + each * place))
        return starts

    # Much of the run remains after the last one.
    latest = min(max(_CHOSEN * lasts, first + count * each), lasts - each)
    if moment is None:
        return np.array(chosen(count, first, latest))
    part = min(each, _PROVEN)
    since = subject_of(timeline.run, timeline.playback).since
    fast = int(since is not None and count > 1)
    wished = (moment - timeline.start) / timeline.playback - (_CLOSED if fast else _BEFORE) * part
    proves = min(max(wished, first), lasts - each)
    begun = proves if since is None else (since - timeline.start) / timeline.playback
    begins = min(max(begun, first), proves)
    before = min(count - 1 - fast, int((begins - first) / each))
    after = count - 1 - fast - before
    return np.array(
        [
            *chosen(before, first, begins - each),
            *[begins] * fast,
            proves,
            *chosen(after, proves + part, latest),
        ]
    )


def _news(timeline: Timeline, times: Float) -> Float:
    """How much happens at times (m,) of a run: walls come and go in its map."""
    run = timeline.run
    scans = np.searchsorted(run.trajectory.times, times, side="right") - 1
    numbers = np.array([run.snapshot_after(max(scan, 0)) for scan in scans.tolist()])
    step = 1 + len(numbers) // _SNAPSHOTS
    known = np.array(
        [lengths(run.maps[k].segments).sum() if k >= 0 else 0.0 for k in numbers[::step].tolist()]
    )
    grown = np.diff(np.interp(np.arange(len(times)), np.arange(len(numbers))[::step], known))
    return np.asarray(np.abs(np.append(grown, 0.0)))


def _settled(timeline: Timeline) -> float:
    """When the map has changed for the most part [s]; the end if nothing is mapped."""
    grid = np.linspace(timeline.start, timeline.end, _MOMENTS)
    changed = np.cumsum(_news(timeline, grid))
    return float(grid[np.searchsorted(changed, _MOST * changed[-1], side="right") - 1])


def run_times(shots: tuple[Shot, ...], passed: Float) -> Float:
    """Times (m,) of the run [s] that a film shows at its own times (m,) [s]."""
    begins = np.cumsum([0.0, *(shot.length for shot in shots[:-1])])
    number = np.clip(np.searchsorted(begins, passed, side="right") - 1, 0, len(shots) - 1)
    starts = np.array([shot.start for shot in shots])
    rates = np.array([(shot.end - shot.start) / max(shot.length, 1e-9) for shot in shots])
    return np.asarray(starts[number] + rates[number] * (passed - begins[number]))
