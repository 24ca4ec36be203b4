"""What films say: a caption and two facts, all numbers where they are asked for, a card at the end.

A run and a moment of it enter, lines of text leave. Numbers keep their places: text that trembles
cannot be read in a film.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.run import Run
from lrf3d.scene import look
from lrf3d.scene.estimate import TRUTH, estimate_words
from lrf3d.scene.shapes import Label
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Moment
from lrf3d.scoring import score_run
from lrf3d.text import counted

PANELS = ("full", "short")
"""What a panel may say: all numbers, or three facts."""

_SIZE, _FULL_SIZE, _CARD_SIZE = 34.0, 19.0, 38.0
"""Heights of letters [pixels of 720 lines]: a film that is shown 390 pixels wide is legible."""

_INK, _PALE = (255, 255, 255), (196, 216, 242)

_CAPTIONS = {
    "unknown": "Nothing is known yet",
    "rise": "The map draws itself",
    "close": "Each hit is a point on a wall",
    "high": "Points become walls, walls become objects",
    "whole": "The map so far",
    "end": "The finished map",
}
"""What each shot shows; of the chase, what the laser does."""


class Facts(NamedTuple):
    """What is the same in a whole film."""

    run: Run
    structures: Structures
    playback: float
    panel: str


def caption(run: Run, shot: str) -> str:
    """What a shot shows; a world's own camera is named."""
    if shot == "chase":
        return _laser(run)
    return _CAPTIONS.get(shot, shot)


def _laser(run: Run) -> str:
    """How much the laser sends out."""
    gaps = np.diff(run.trajectory.times)
    beams = f"{run.ranges.shape[1]} laser beams"
    rate = 1.0 / float(np.median(gaps)) if len(gaps) and np.median(gaps) > 0.0 else 0.0
    return f"{beams}, {rate:.3g} times a second" if rate >= 1.0 else f"{beams} a scan"


def panel(facts: Facts, moment: Moment, shot: str) -> Label:
    """The panel of a moment."""
    run, line_map = facts.run, facts.run.map_after(moment.scan)
    walls = f"{len(line_map):>4} walls found" if run.maps else ""
    if shot == "unknown" and len(line_map):
        shot = "chase"
    lines = [(caption(run, shot), _INK), (f"{moment.time:4.0f} s  {walls}".rstrip(), _PALE)]
    if facts.panel == "short":
        lines += [(words, colour) for words, colour in _trails(run, moment.scan)]
        return _label(lines, _SIZE, "top")
    x, y, turn = *moment.pose[:2], np.degrees(moment.pose[2])
    scan = run.scan(moment.scan)
    nearest = f"min {scan.ranges[scan.hits].min():6.2f} m" if scan.hits.any() else "nothing near"
    beams = f"{int(scan.hits.sum())} / {len(scan.ranges)} beams hit   {nearest}"
    lines[1:] = [
        (f"t {moment.time:8.1f} s     v {moment.speed:6.2f} m/s   {facts.playback:g} x", _PALE),
        (f"x {x:8.2f} m  y {y:8.2f} m  θ {turn:7.1f}°", _PALE),
        (beams if moment.scanning else "driving on, beams off", (255, 168, 140)),
        *_trails(run, moment.scan),
        (line_map.counts if run.maps else "", _PALE),
    ]
    return _label(lines, _FULL_SIZE, "top")


def card(facts: Facts) -> Label:
    """What was found in the end."""
    run = facts.run
    structures = facts.structures
    town = not structures.indoor and len(structures.houses) > 0
    found = counted(run.map.object_count, "building" if town else "object")
    words = [found, counted(len(run.map), "wall")]
    if run.knows_truth:
        words.append(f"{100.0 * score_run(run).length_recall:.0f} % found")
    return _label([(", ".join(words), _INK)], _CARD_SIZE, "middle")


def _trails(run: Run, scan: int) -> list[tuple[str, tuple[int, int, int]]]:
    """The names of the two trails in their colours, and how far they are apart."""
    found = []
    for name, apart in estimate_words(run, scan):
        colour = look.TRAIL_COLOUR if name == TRUTH else look.ESTIMATE_COLOUR
        # On a dark panel colours are read more easily when they are paler.
        red, green, blue = (round(255 * (0.65 * part + 0.35)) for part in colour)
        found.append((f"━ {name}  {apart}".rstrip(), (red, green, blue)))
    return found


def _label(lines: list[tuple[str, tuple[int, int, int]]], size: float, place: str) -> Label:
    shown = [(words[:60], colour) for words, colour in lines if words]
    return Label(
        tuple(words for words, _ in shown), tuple(colour for _, colour in shown), size, place
    )
