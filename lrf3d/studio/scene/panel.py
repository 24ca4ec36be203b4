"""The text of films: a caption with one number, all numbers if asked for, a card at the end.

A run and a moment of it enter, lines of text leave.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from lrf3d.base.text import counted
from lrf3d.geometry.lines import lengths
from lrf3d.scoring.map_score import found_words, judged_part, score_run
from lrf3d.simulation.run import Run
from lrf3d.studio.scene import look
from lrf3d.studio.scene.bodies import robot_names, robots_of
from lrf3d.studio.scene.camera import Look
from lrf3d.studio.scene.clouds import HEIGHT_COLOURS
from lrf3d.studio.scene.drift import GAP_COLOUR, GHOST_COLOUR, drift_of
from lrf3d.studio.scene.found import distances, false_after, false_words, found_after, lost_walls
from lrf3d.studio.scene.glass import BACK_COLOUR
from lrf3d.studio.scene.marks import TRUTH, estimate_words
from lrf3d.studio.scene.shapes import NAMED, PINNED, Label
from lrf3d.studio.scene.shots import FIRST_SHOT, PROOF, SHOTS
from lrf3d.studio.scene.subject import TITLE_TIME, beams_told, subject_of
from lrf3d.studio.scene.timeline import Moment, lasting

# Kinds of panels: all numbers, or three facts.
PANELS = ("full", "short")

# Height of letters [pixels of 720 lines], legible in a film that is shown 390 pixels wide.
SIZE = 40.0

# Height of letters where all numbers are said [pixels of 720 lines].
_FULL_SIZE = 19.0

# Colour of the first line, 0…255.
INK = (236, 240, 247)

# Colour of the other lines, 0…255.
PALE = (184, 196, 216)

# All shots of the film's own cameras.
_SHOTS = (FIRST_SHOT, PROOF, "rise", "whole", *SHOTS)


def _caption(run: Run, moment: Moment, shot: str, playback: float) -> str:
    """What a shot shows, with one number; a world's own camera is named."""
    if shot == "whole" and moment.time - run.trajectory.times.min() < TITLE_TIME * playback:
        return subject_of(run, playback).title
    return _mapped(run, moment.mapped) if shot in _SHOTS else shot


def _mapped(run: Run, scan: int) -> str:
    """What the map holds after a scan: walls found, if they are known, or else its segments."""
    if not run.maps:
        return counted(run.ranges.shape[1], "laser beam")
    found = found_after(run, scan)
    if not len(found):
        segments = len(run.map_after(scan))
        return f"{counted(segments, 'segment')} mapped" if segments else distances(run, scan)
    false = false_words(false_after(run, scan))
    return f"{found.sum()} of {counted(len(found), 'wall')} found{false}"


def has_card(run: Run, moment: Moment, view: Look) -> bool:
    """Whether the panel of a moment through a look is the card."""
    # A last stop is shown for a while.
    return view.shot == "end" or (view.shot == "whole" and moment.mapped == len(run) - 1)


def panel(
    run: Run,
    moment: Moment,
    view: Look,
    playback: float,
    *,
    full: bool = False,
    robots: Sequence[str] = (),
) -> Label:
    """The panel of a moment through a look; at the end of a story the card.

    Robots have names where each has a map, the run's own first.
    """
    if has_card(run, moment, view):
        drifted = [(words, whole(tint)) for words, tint in _drifted(run, moment, playback)]
        return _label([*_card(run, playback), *drifted])
    head, *said = view.said or [""]
    head = head or _caption(run, moment, view.shot, playback)
    if full:
        said = _numbers(run, moment, playback)
        said += [run.map_after(moment.mapped).counts] * bool(run.maps)
    said = said or [_passed(run, moment, playback, head, view.shot)]
    others = [
        *((words, PALE) for words in said),
        *_trails(run, moment, view.shot, playback, robots),
    ]
    return _label([(head, INK), *others], _FULL_SIZE if full else SIZE)


def _passed(run: Run, moment: Moment, playback: float, head: str, shot: str) -> str:
    """How much time has passed, how fast, and the map's segments if the head does not say."""
    seconds = moment.time - run.trajectory.times.min()
    words = lasting(seconds)
    # While the map is completed the run passes faster than elsewhere, and its subject slower.
    if playback > 1.0 and shot not in ("rise", "whole", "proof"):
        words += f" at {playback:.2g} × speed"
    mapped = _mapped(run, moment.mapped)
    # Of several robots each map has its number.
    several = robots_of(run.obstacles)
    return words if mapped in head or several or not run.maps else f"{words}  ·  {mapped}"


def _numbers(run: Run, moment: Moment, playback: float) -> list[str]:
    """Lines of numbers: the time, the pose, and what the laser sees."""
    x, y, theta = moment.pose
    scan = run.scan(moment.scan)
    nearest = f"min {scan.ranges[scan.hits].min():.2f} m" if scan.hits.any() else "nothing near"
    beams = f"{int(scan.hits.sum())} / {len(scan.ranges)} beams hit   {nearest}"
    return [
        f"t {moment.time:.1f} s   v {moment.speed:.2f} m/s   {playback:g} x",
        f"x {x:.2f} m   y {y:.2f} m   θ {np.degrees(theta):.1f}°",
        beams if moment.scanning else "beams off",
    ]


@lru_cache(1)
def _card(run: Run, playback: float) -> tuple[tuple[str, tuple[int, int, int]], ...]:
    """What was found in the end, in lines: of the visible walls, if the truth is known."""
    rest = "what it never saw stays dark"
    if not run.maps:
        found = f"{_mapped(run, -1)}, {counted(len(run), 'scan')}"
    elif not (run.knows_truth and len(run.world.segments)):
        driven = lengths(np.hstack([run.trajectory.poses[:-1, :2], run.trajectory.poses[1:, :2]]))
        found = f"{distances(run)} became {counted(len(run.map), 'segment')}"
        objects = counted(run.map.object_count, "object")
        rest = f"{driven.sum():.0f} m driven  ·  {objects}"
    else:
        found = found_words(score_run(judged_part(run)).as_dict())
        found += false_words(false_after(run, len(run) - 1))
    lost = lost_walls(run).words
    missed = [(f"{NAMED} {lost}", whole(look.FALSE_COLOUR))] * bool(lost)
    subject = subject_of(run, playback)
    pins = f"{PINNED} " * bool(len(subject.pinned))
    told = [(pins + subject.found, INK)] * bool(subject.found)
    colour = PALE if told else INK
    return (*told, (found, colour), *missed, (rest * (not told), PALE))


def _drifted(run: Run, moment: Moment, playback: float) -> list[tuple[str, look.Colour]]:
    """The names of the path by odometry alone, and of how far it is off at a moment."""
    drift = drift_of(run)
    gap = drift.words(moment, playback) if drift else ""
    return [("━ odometry alone", GHOST_COLOUR), (f"━ {gap}", GAP_COLOUR)] if gap else []


def _trails(
    run: Run, moment: Moment, shot: str, playback: float, robots: Sequence[str]
) -> list[tuple[str, tuple[int, int, int]]]:
    """The names of trails and of single beams in their colours, and how far trails are apart."""
    found = [
        (f"━ {name}  {apart}", look.TRAIL_COLOUR if name == TRUTH else look.ESTIMATE_COLOUR)
        for name, apart in estimate_words(run, moment.scan)
    ]
    if others := robots_of(run.obstacles):
        colours = [look.TRAIL_COLOUR, *(colour for _, colour in others)]
        names = robot_names(run.obstacles, robots)
        found += [(f"━ {name}", colour) for name, colour in zip(names, colours, strict=False)]
    found += _drifted(run, moment, playback)
    found += _beams(run, moment, playback, shot) if moment.mapped >= 0 else []
    red, green, blue = HEIGHT_COLOURS[1].tolist()
    found += [("━ points of a lidar", (red, green, blue))] * bool(run.cloud_sensors.lidars)
    return [(words.rstrip(), whole(colour)) for words, colour in found]


def _beams(run: Run, moment: Moment, playback: float, shot: str) -> list[tuple[str, look.Colour]]:
    """The names of single beams, and their colours."""
    beams = beams_told(run, moment, playback, shot)
    found = [(f"━ {each.words}", each.colour) for each in beams]
    if subject_of(run, playback).aim_at(moment.time) is not None:
        found.append(("━ a beam that the mirror turns", BACK_COLOUR))
        found.append(("━ where the laser thinks it goes", look.FALSE_COLOUR))
    return found


def whole(colour: look.Colour) -> tuple[int, int, int]:
    """A colour for text in whole numbers, paler on its dark ground."""
    red, green, blue = (round(255 * part) for part in look.paler(colour))
    return red, green, blue


def _label(lines: list[tuple[str, tuple[int, int, int]]], size: float = SIZE) -> Label:
    text, colours = zip(*(line for line in lines if line[0]), strict=True)
    return Label(text, colours, size)
