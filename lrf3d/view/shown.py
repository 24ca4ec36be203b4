"""What a page shows: a run that is played, or a drive by hand, as messages for the page.

The page asks for a time and a view, or for speeds to drive at; the scene of that moment leaves.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from lrf3d.geometry import Float
from lrf3d.run import Run
from lrf3d.scene import look
from lrf3d.scene.camera import Camera, Look, SmoothPath
from lrf3d.scene.cameras import margins
from lrf3d.scene.estimate import TRUTH, estimate_words
from lrf3d.scene.following import First, behind, chase
from lrf3d.scene.moments import Scene
from lrf3d.scene.shapes import Faces, Lens, Mark
from lrf3d.scene.stage import Stage
from lrf3d.scene.story import Story
from lrf3d.scene.timeline import Moment, Timeline
from lrf3d.scene.whole import overview, top
from lrf3d.view.hand_drive import HandDrive
from lrf3d.view.message import Sender

VIEWS = ("story", "follow", "orbit", "top", "first")
"""Names of the page's views; a drive by hand has no story."""

_LIMITS = {
    "time": (-1e9, 1e9),
    "width": (16, 8192),
    "height": (16, 8192),
    "around": (-1e3, 1e3),
    "over": (-1e3, 1e3),
    "zoom": (0.1, 10.0),
    "forward": (-1.0, 1.0),
    "turn": (-1.0, 1.0),
}
"""The least and the largest of the numbers that a page sends."""

_LOWEST, _STEEPEST = math.radians(4.0), math.radians(88.0)
"""How steeply a look that a hand has turned goes down."""

_OVER_BAR, _OVER_PADS, _UPRIGHT = -0.25, -0.1, math.radians(70.0)
"""Where a robot that is followed is seen, from the middle up, in halves of the picture's height:
below it is the bar, and in upright pictures pads; these have a wider angle of view [rad]."""

_PLAN_SIDE = 0.3
"""Side of the plan in the corner, as a share of the shorter side of the picture."""

_COARSE = 0.5
"""Bands of the map are made again when the eye has moved by this share of its height, or by four
metres: few are sent."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a page wants to see and do."""

    view: str = "follow"
    time: float = 0.0
    """Time from the start of the run on [s]; a story begins before it and goes on after its end."""
    width: float = 1280.0
    height: float = 720.0
    """Size of the picture [pixels]."""
    around: float = 0.0
    over: float = 0.0
    """How far the hand has turned the camera round what it looks at, and upward [rad]."""
    zoom: float = 1.0
    """How many times as far away it is."""
    forward: float = 0.0
    turn: float = 0.0
    """What shares of its highest speeds the robot is to have."""

    def changed(self, text: str) -> "Wanted":
        """What is wanted after a message from the page; a malformed one changes nothing."""
        try:
            sent = json.loads(text)
            new = {name: float(sent.get(name, getattr(self, name))) for name in _LIMITS}
        except (ArithmeticError, AttributeError, TypeError, ValueError):
            return self
        if not all(low <= new[name] <= high for name, (low, high) in _LIMITS.items()):
            return self
        view = sent.get("view")
        return Wanted(view if view in VIEWS else self.view, **new)


class Shown(Protocol):
    """Something on a page."""

    def answer(self, wanted: Wanted, seconds: float) -> bytes | None:
        """The message for a page that wants this, after some seconds; None if it has all."""
        ...


class _Page:
    """A scene and what a page has of it."""

    def __init__(self, scene: Scene, cameras: Mapping[str, Camera]) -> None:
        self.scene = scene
        self._sender = Sender()
        timeline, structures = scene.timeline, scene.structures
        self._cameras: dict[str, Camera] = {
            "orbit": overview(timeline, structures),
            "top": top(timeline, structures),
            "first": First(timeline, structures),
            **cameras,
        }
        self._middle, self._window = scene.plan_window()
        ends = structures.segments.reshape(-1, 2)
        if "story" not in cameras and np.ptp(ends, axis=0).max(initial=0.0) > look.INSET_WHOLE:
            # Nobody knows the path of a drive, so that its plan goes with the robot.
            self._middle, self._window = None, look.INSET_FOLLOWED
        # The longest of 1, 2 and 5 times a power of ten that takes up to a third of the plan.
        power = 10.0 ** math.floor(math.log10(self._window / 3.0))
        self._scale = power * max(n for n in (1, 2, 5) if n * power <= self._window / 3.0)
        self._map: tuple[object, Faces] | None = None

    def message(self, moment: Moment, wanted: Wanted, words: Mapping[str, str]) -> bytes | None:
        """What is seen at a moment."""
        size = round(wanted.width), round(wanted.height)
        view = self._look(wanted)
        seen = self.scene.seen(moment, view, size)
        bodies = dict(seen.bodies)
        marks: dict[str, Mark | Faces] = {name: body.faces for name, body in seen.bodies}
        if "map" in marks:
            marks["map"] = self._standing(bodies["map"].faces, moment, view)
        plan = None
        if view.plan:
            box = (0, 0, max(1, round(_PLAN_SIDE * min(size))))
            shown = self.scene.plan(moment, box, self._middle, self._window)
            marks.update(shown.marks)
            plan = {
                "camera": _camera(shown.lens),
                "order": [name for name, _ in shown.marks],
                "back": [part / 255 for part in look.PLAN_BACK],
                "metres": self._scale,
                "share": self._scale / self._window,
            }
        marks.update(seen.marks)
        camera = {
            **_camera(seen.lens),
            "scale": max(min(size) / 720.0, look.LEAST_SCALE),
            "ray": _numbers(np.linalg.inv(_upright(seen.lens))),
            "ghost": seen.ghost,
            "cut": seen.cut,
        }
        values = {
            "camera": camera,
            "plan": plan,
            "bodies": {name: _numbers(body.pose) for name, body in bodies.items()},
            "order": [name for name, _ in seen.marks],
            "words": dict(words),
        }
        return self._sender.message(marks, values)

    def _look(self, wanted: Wanted) -> Look:
        aspect = wanted.width / wanted.height
        camera = self._cameras.get(wanted.view, self._cameras["follow"])
        view = camera.look(self.scene.timeline.start + wanted.time, aspect)
        if wanted.view == "follow":
            view = replace(view, shift=_OVER_BAR)
            if aspect < 1.0:
                view = replace(view, shift=_OVER_PADS, field=_UPRIGHT)
        if (wanted.around, wanted.over, wanted.zoom) != (0.0, 0.0, 1.0):
            view = _turned(view, wanted)
        return view

    def _standing(self, bands: Faces, moment: Moment, view: Look) -> Faces:
        """The bands of the map, as an eye sees them that moves in steps."""
        step = max(4.0, _COARSE * float(view.eye[2]))
        stage = self.scene.run.snapshot_after(moment.scan)
        key = stage, np.round(view.eye / step).tobytes(), view.field, view.raised
        if self._map is None or self._map[0] != key:
            self._map = key, bands
        return self._map[1]


def _turned(view: Look, wanted: Wanted) -> Look:
    """A look that a hand has turned about its target."""
    away = view.eye - view.target
    level = math.hypot(away[0], away[1])
    steep = math.atan2(away[2], level)
    over = min(max(steep + wanted.over, _LOWEST), _STEEPEST) - steep
    right = np.array([-away[1], away[0], 0.0]) / max(level, 1e-9)
    turn = Rotation.from_rotvec([0.0, 0.0, wanted.around]) * Rotation.from_rotvec(-over * right)
    return replace(view, eye=view.target + wanted.zoom * turn.apply(away))


def _upright(lens: Lens) -> Float:
    """The matrix of a lens for a picture whose first row is the lower one, as browsers have it."""
    return np.asarray(lens.matrix * np.array([[1.0], [-1.0], [1.0], [1.0]]))


def _camera(lens: Lens) -> dict[str, Any]:
    """A lens for the page."""
    others = {"thick": lens.thick, "slack": lens.slack, "nearer": lens.nearer, "focus": lens.focus}
    return {"matrix": _numbers(_upright(lens)), "eye": _numbers(lens.eye), **others}


def _numbers(values: Any) -> list[float]:
    """Numbers for JSON, of matrices column by column, as exactly as float32 has them."""
    return [float(f"{value:.8g}") for value in np.asarray(values).T.ravel().tolist()]


def _words(moment: Moment, turning: float, ranges: Float) -> dict[str, str]:
    """Where the robot is, how it moves, and what its laser sees."""
    x, y, theta = moment.pose
    turn = math.degrees(math.remainder(theta, 2.0 * math.pi))
    numbers = {"v": (moment.speed, 2), "w": (math.degrees(turning), 0), "x": (x, 2), "y": (y, 2)}
    words = {name: f"{value:z.{digits}f}" for name, (value, digits) in numbers.items()}
    hits = ranges[np.isfinite(ranges)]
    nearest = f"{hits.min():.2f} m" if len(hits) else "none"
    beams = f"{len(hits)} / {len(ranges)} beams hit, min {nearest}"
    words["beams"] = beams if moment.scanning else "beams off"
    return {"t": f"{moment.time:.1f}", "theta": f"{turn:z.1f}", **words}


class Played:
    """A run that is played."""

    def __init__(self, run: Run, stage: Stage, playback: float) -> None:
        timeline = self._timeline = Timeline(run, playback=playback)
        structures = stage.structures
        cameras: dict[str, Camera] = {
            "story": Story(timeline, structures),
            "follow": chase(timeline, structures),
        }
        self._page, self._run = _Page(Scene(timeline, stage=stage), cameras), run
        self._last: Wanted | None = None

    def answer(self, wanted: Wanted, seconds: float) -> bytes | None:
        """The scene at the time that is wanted."""
        if wanted == self._last:
            return None
        self._last, run = wanted, self._run
        moment = self._timeline.moment(self._timeline.start + wanted.time)
        before, after = self._timeline.poses(moment.time + np.array([-0.05, 0.05]))[:, 2]
        turning = 0.0 if self._timeline.dwells else math.remainder(after - before, math.tau) / 0.1
        words = _words(moment, turning, run.ranges[moment.scan])
        words["map"] = run.map_after(moment.scan).counts if run.maps else "no map yet"
        for name, apart in estimate_words(run, moment.scan):
            words["truth" if name == TRUTH else "believed"] = f"{name} {apart}".strip()
        return self._page.message(moment, wanted, words)


class Driven:
    """A robot that is driven by hand."""

    def __init__(self, drive: HandDrive) -> None:
        self.drive = drive
        self._page = _Page(drive.scene, {"follow": _Behind(drive)})
        self._last: Wanted | None = None

    def answer(self, wanted: Wanted, seconds: float) -> bytes | None:
        """The scene after the robot has driven on."""
        drive = self.drive
        moved = drive.step(seconds, wanted.forward, wanted.turn)
        if not moved and wanted == self._last:
            return None
        self._last = wanted
        words = _words(drive.moment(), drive.turning, drive.latest.ranges)
        words["map"] = drive.line_map.counts
        words["stop"] = "a wall is in the way" if drive.bumped else ""
        return self._page.message(drive.moment(), wanted, words)


class _Behind:
    """Follows a robot that is driven by hand, as the film's camera follows one in a run."""

    def __init__(self, drive: HandDrive) -> None:
        self._drive = drive

    def look(self, time: float, aspect: float) -> Look:
        """The look of now."""
        drive, structures = self._drive, self._drive.scene.structures
        places = np.array([drive.pose[:2]]) - drive.scene.origin
        now = SmoothPath(np.zeros(1), places, np.array([drive.facing]))
        track = behind(now, structures).past_walls(structures, places, 1.0)
        return track.look(0.0, cuts=True)


def setup_of(scene: Scene, views: tuple[str, ...], *, end: float) -> dict[str, Any]:
    """What a page is given once, as values for JSON; a drive has no end."""
    speed = scene.timeline.playback
    before, after = margins("story")
    trail, estimate = (
        [round(255 * (0.65 * part + 0.35)) for part in colour]
        for colour in (look.TRAIL_COLOUR, look.ESTIMATE_COLOUR)
    )
    return {
        "title": scene.run.world.name or "run",
        "views": views,
        "end": end,
        "story": [-before * speed, end + after * speed],
        "speed": speed,
        "trail": trail,
        "estimate": estimate,
    }
