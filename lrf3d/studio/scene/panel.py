"""What films say: a caption with one number, all numbers if asked for, a card at the end.

A run and a moment of it enter, lines of text leave.
"""

from functools import lru_cache

import numpy as np
import shapely

from lrf3d.base.text import counted
from lrf3d.simulation.run import Run
from lrf3d.studio.scene import look
from lrf3d.studio.scene.camera import Look
from lrf3d.studio.scene.marks import TRUTH, estimate_words
from lrf3d.studio.scene.shapes import Label
from lrf3d.studio.scene.timeline import Moment

# What a panel may say: all numbers, or three facts.
PANELS = ("full", "short")

# Heights of letters [pixels of 720 lines], legible in a film that is shown 390 pixels wide; and
# colours of the first line and of the others, 0…255.
_SIZE = 30.0
_FULL_SIZE = 19.0
_INK = (236, 240, 247)
_PALE = (184, 196, 216)

# Time for which a loss of walls behind mirrors is mentioned [s of the film], and the least such
# loss; a wall is found if the map lies within a distance [m] of it along a share of its length.
_REFLECTION_TIME = 4.0
_DROPPED = 3
_FOUND = 0.1
_FOUND_SHARE = 0.5


def _caption(run: Run, moment: Moment, shot: str) -> str:
    """What a shot shows, with one number; a world's own camera is named."""
    line_map = run.map_after(moment.mapped)
    if moment.mapped < 0:
        return "The robot knows nothing yet"
    if shot in ("chase", "close") and (words := _reflected(run, moment)):
        return words
    if shot == "close":
        return f"{np.isfinite(run.ranges[: moment.scan + 1]).sum():,} distances measured"
    if shot in _WALLS and len(line_map):
        return f"{counted(len(line_map), 'wall')} in the map"
    if shot == "high" and len(line_map):
        return f"{counted(line_map.object_count, 'object')}, each in its own colour"
    if shot not in _SHOTS:
        return shot
    gaps = np.diff(run.trajectory.times)
    beams = f"{len(run.ranges.T)} laser beams"
    if shot == "wave":
        return f"{beams} light up what they reach"
    rate = 1.0 / float(np.median(gaps)) if len(gaps) and np.median(gaps) > 0.0 else 0.0
    return f"{beams}, {round(rate, 1):g} times a second" if rate >= 1.0 else f"{beams} a scan"


# Shots whose caption counts walls, and all shots of the film's own cameras.
_WALLS = ("rise", "whole", "end")
_SHOTS = ("wave", "chase", "close", "high", *_WALLS)


def _reflected(run: Run, moment: Moment) -> str:
    """Words on the walls that the map has dropped in the last seconds since it knows a mirror."""
    line_map = run.map_after(moment.mapped)
    if "mirror" not in line_map.kinds:
        return ""
    then = moment.time - _REFLECTION_TIME * run.playback
    earlier = max(int(np.searchsorted(run.trajectory.times, then)) - 1, 0)
    most = max(len(run.map_after(scan)) for scan in range(earlier, moment.mapped + 1))
    dropped = most - len(line_map)
    said = f"The room in the mirror is a reflection: {dropped} walls dropped"
    return said if dropped >= _DROPPED else ""


def panel(run: Run, moment: Moment, view: Look, playback: float, *, full: bool = False) -> Label:
    """The panel of a moment through a look; at the end of a story the card."""
    # A share of the glass, and when seconds are too many [s].
    card_from = 0.9
    minutes = 600.0
    if view.shot == "end" and view.glass >= card_from:
        return _card(run)
    line_map = run.map_after(moment.mapped)
    walls = counted(len(line_map), "wall") if run.maps else ""
    head = _caption(run, moment, view.shot), _INK
    if not full:
        seconds = moment.time - run.trajectory.times.min()
        passed = f"{seconds:.0f} s" if seconds < minutes else f"{seconds / 60.0:.0f} min"
        if playback > 1.0:
            passed += f" at {playback:.2g} × speed"
        if walls and walls not in head[0]:
            passed += f"  ·  {walls}"
        return _label([head, (passed, _PALE), *_trails(run, moment.scan)], _SIZE)
    x, y, theta = moment.pose
    scan = run.scan(moment.scan)
    nearest = f"min {scan.ranges[scan.hits].min():.2f} m" if scan.hits.any() else "nothing near"
    beams = f"{int(scan.hits.sum())} / {len(scan.ranges)} beams hit   {nearest}"
    lines = [
        head,
        (f"t {moment.time:.1f} s   v {moment.speed:.2f} m/s   {playback:g} x", _PALE),
        (f"x {x:.2f} m   y {y:.2f} m   θ {np.degrees(theta):.1f}°", _PALE),
        (beams if moment.scanning else "beams off", _PALE),
        *_trails(run, moment.scan),
        (line_map.counts if run.maps else "", _PALE),
    ]
    return _label(lines, _FULL_SIZE)


@lru_cache(maxsize=1)
def _card(run: Run) -> Label:
    """What was found in the end: of the walls of the world, if they are known."""
    # A building of several colours is several objects.
    objects = counted(run.map.object_count, "object")
    if not (run.knows_truth and len(run.world.segments)):
        return _label([(f"{counted(len(run.map), 'wall')}, {objects}", _INK)], _SIZE)
    # A wall is found that has a segment of the map along most of its length.
    walls, mapped = (
        shapely.linestrings(each.segments.reshape(-1, 2, 2)) for each in (run.world, run.map)
    )
    near = shapely.union_all(shapely.buffer(mapped, _FOUND, cap_style="flat"))
    shapely.prepare(near)
    along = shapely.length(shapely.intersection(walls, near))
    found = int((along >= _FOUND_SHARE * shapely.length(walls)).sum())
    count = len(walls)
    share = f"{found} of {counted(count, 'wall')} found, {100 * found / count:.0f} %"
    rest = f"what was never seen is glass  ·  {objects}"
    return _label([(share, _INK), (rest, _PALE)], _SIZE)


def _trails(run: Run, scan: int) -> list[tuple[str, tuple[int, int, int]]]:
    """The names of the two trails in their colours, and how far they are apart."""
    found = []
    for name, apart in estimate_words(run, scan):
        colour = look.TRAIL_COLOUR if name == TRUTH else look.ESTIMATE_COLOUR
        red, green, blue = (round(255 * part) for part in look.paler(colour))
        found.append((f"━ {name}  {apart}".rstrip(), (red, green, blue)))
    return found


def _label(lines: list[tuple[str, tuple[int, int, int]]], size: float) -> Label:
    shown = [(words[:60], colour) for words, colour in lines if words]
    return Label(tuple(words for words, _ in shown), tuple(colour for _, colour in shown), size)
