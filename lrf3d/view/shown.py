"""What a page shows: a run that is played, or a drive by hand, as messages for the page.

The page asks for a time and a view, or wishes to drive; the scene of that moment leaves.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from lrf3d.geometry import Float
from lrf3d.run import Run
from lrf3d.scene import look
from lrf3d.scene.camera import Camera, Look
from lrf3d.scene.cameras import margins
from lrf3d.scene.estimate import TRUTH, estimate_words
from lrf3d.scene.following import First
from lrf3d.scene.map_bands import bands
from lrf3d.scene.moments import Scene
from lrf3d.scene.shapes import Faces, Mark, Seen
from lrf3d.scene.stage import Stage
from lrf3d.scene.story import Story
from lrf3d.scene.timeline import Moment, Timeline
from lrf3d.scene.whole import Overview, Top
from lrf3d.view.hand_drive import HandDrive, Wish
from lrf3d.view.message import Sender

VIEWS = ("story", "follow", "orbit", "top", "first")
"""Names of the page's views; a drive by hand has no story."""

_SIZE = (1280, 720)
"""The size of the picture [pixels] that marks are made for."""

_PLAN_SIDE = 216
"""Side of the plan in the corner [pixels of that picture]."""

_BEHIND, _FIELD = np.array([-4.4, 0.0, 2.3]), float(np.radians(50.0))
"""Where the eye of a view by hand is taken to be from the robot [m], and its angle of view."""

_COARSE = 0.5
"""Bands are made anew when the eye has moved by this share of its height."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a page wants to see and do: what it sends is checked here."""

    view: str = "follow"
    time: float = 0.0
    """Time from the start of the run on [s]; a story begins before it and goes on after its end."""
    aspect: float = 16 / 9
    eye: tuple[float, float, float] | None = None
    """Where the eye is, if the page's hand moves it."""
    wish: Wish = field(default_factory=Wish)

    def changed(self, sent: object) -> "Wanted":
        """What is wanted after a message from the page; what is malformed in it is ignored."""
        new = {name: getattr(self, name) for name in Wanted.__slots__}
        if isinstance(sent, Mapping):
            if sent.get("view") in VIEWS:
                new["view"], new["eye"] = sent["view"], None
            for name, low, high in (("time", -1e9, 1e9), ("aspect", 0.1, 10.0)):
                if _is_number(sent.get(name), low, high):
                    new[name] = float(sent[name])
            eye = sent.get("eye")
            if isinstance(eye, list) and len(eye) == 3:
                if all(_is_number(part, -1e9, 1e9) for part in eye):
                    new["eye"] = tuple(map(float, eye))
            ways = [sent.get("forward"), sent.get("turn")]
            if all(_is_number(way, -1.0, 1.0) for way in ways):
                new["wish"] = Wish(*map(float, ways))  # type: ignore[arg-type]
        return Wanted(**new)


def _is_number(value: object, low: float, high: float) -> bool:
    return isinstance(value, int | float) and low <= value <= high


class Shown(Protocol):
    """Something on a page."""

    def answer(self, wanted: Wanted, seconds: float) -> bytes | None:
        """The message for a page that wants this, after some seconds; None if it has all."""
        ...


class _Stage:
    """A scene and what a page has of it."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._sender = Sender()
        timeline, structures = scene.timeline, scene.structures
        self._cameras: dict[str, Camera] = {
            "story": Story(timeline, structures),
            "orbit": Overview(timeline, structures),
            "top": Top(timeline, structures),
            "first": First(timeline, structures),
        }
        self._middle, self._window = scene.plan_window()
        # The longest of 1, 2 and 5 times a power of ten that takes up to a third of the plan.
        power = 10.0 ** math.floor(math.log10(self._window / 3.0))
        self._scale = power * max(n for n in (1, 2, 5) if n * power <= self._window / 3.0)
        self._bands: tuple[object, Faces] | None = None

    def message(self, moment: Moment, wanted: Wanted, words: Mapping[str, Any]) -> bytes | None:
        """What is seen at a moment."""
        pose = moment.pose - [*self.scene.origin, 0.0]
        view = self._look(self.scene.timeline.start + wanted.time, pose, wanted)
        seen = self.scene.seen(moment, view, _SIZE)
        marks: dict[str, Mark | Faces] = dict(seen.marks)
        if any(name == "map" for name, _ in seen.bodies):
            marks["map"] = self._standing(moment, view, seen)
        box = (0, 0, _PLAN_SIDE)
        plan = self.scene.plan(moment, box, self._middle, self._window)
        marks.update(plan.marks)
        bodies = {
            name: np.round(body.pose.T.ravel(), 5).tolist()
            for name, body in seen.bodies
            if name != "map"
        }
        middle = pose[:2] if self._middle is None else self._middle
        others = {
            "bodies": bodies,
            "camera": {"view": wanted.view, **_camera(view, seen)},
            "plan": [*np.round(middle, 3).tolist(), self._window, self._scale]
            if view.plan
            else None,
            "order": list(marks),
            "words": dict(words),
        }
        return self._sender.message(marks, others)

    def _look(self, time: float, pose: Float, wanted: Wanted) -> Look:
        if wanted.eye is None and wanted.view in self._cameras:
            return self._cameras[wanted.view].look(time, wanted.aspect)
        x, y, theta = pose
        target = np.array([x, y, 0.4])
        back = math.cos(theta) * _BEHIND[0], math.sin(theta) * _BEHIND[0], _BEHIND[2]
        eye = target + back if wanted.eye is None else np.array(wanted.eye)
        return Look(eye, target, _FIELD)

    def _standing(self, moment: Moment, view: Look, seen: Seen) -> Faces:
        """The bands of the map, as an eye sees them that moves in steps: few are sent."""
        step = max(4.0, _COARSE * float(view.eye[2]))
        eye = step * np.round(view.eye / step)
        stage = self.scene.run.snapshot_after(moment.scan)
        key = (stage, eye.tobytes(), view.field, view.raised)
        if self._bands is None or self._bands[0] != key:
            drawn = self.scene.drawn_map(moment.scan)
            least = 0.5 * look.BAND_PIXELS * min(_SIZE) / 720.0 / seen.lens.focus
            tops = self.scene.tops.of(drawn.segments)
            self._bands = key, bands(drawn, tops, eye, least=least, raised=view.raised)
        return self._bands[1]


def _camera(view: Look, seen: Seen) -> dict[str, Any]:
    """A look for the page."""
    cut = seen.cut
    return {
        "eye": np.round(view.eye, 4).tolist(),
        "target": np.round(view.target, 4).tolist(),
        "up": list(view.up),
        "field": round(math.degrees(view.field), 4),
        "shift": view.shift,
        "near": view.near,
        "thick": seen.lens.thick,
        "nearer": seen.lens.nearer,
        "slack": seen.lens.slack,
        "ghost": round(view.ghost, 4),
        "cut": None if cut is None else [*cut.robot.tolist(), *cut.toward.tolist(), cut.slope],
    }


def _pose_words(moment: Moment, turning: float) -> dict[str, str]:
    x, y, theta = moment.pose
    turn = math.degrees(math.remainder(theta, 2.0 * math.pi))
    numbers = {"v": (moment.speed, 2), "w": (math.degrees(turning), 0), "x": (x, 2), "y": (y, 2)}
    words = {name: f"{value:z.{digits}f}" for name, (value, digits) in numbers.items()}
    return {"t": f"{moment.time:.1f}", "theta": f"{turn:z.1f}", **words}


def _scan_words(ranges: Float, *, scanning: bool) -> str:
    if not scanning:
        return "beams off"
    hits = ranges[np.isfinite(ranges)]
    nearest = f"{hits.min():.2f} m" if len(hits) else "none"
    return f"{len(hits)} / {len(ranges)} beams hit, min {nearest}"


class Played:
    """A run that is played."""

    def __init__(self, run: Run, stage: Stage, playback: float) -> None:
        scene = Scene(Timeline(run, playback=playback), stage=stage)
        self._stage, self._run, self._timeline = _Stage(scene), run, scene.timeline
        self._last: Wanted | None = None

    def answer(self, wanted: Wanted, seconds: float) -> bytes | None:
        """The scene at the time that is wanted."""
        if wanted == self._last:
            return None
        self._last, run = wanted, self._run
        moment = self._timeline.moment(self._timeline.start + wanted.time)
        step = 0.05 * np.array([-1.0, 1.0])
        before, after = self._timeline.poses(moment.time + step)[:, 2]
        turning = 0.0 if self._timeline.dwells else math.remainder(after - before, math.tau) / 0.1
        words: dict[str, Any] = _pose_words(moment, turning)
        words["beams"] = _scan_words(run.ranges[moment.scan], scanning=moment.scanning)
        words["map"] = run.map_after(moment.scan).counts if run.maps else "no map yet"
        for name, apart in estimate_words(run, moment.scan):
            words["truth" if name == TRUTH else "believed"] = f"{name} {apart}".strip()
        return self._stage.message(moment, wanted, words)


class Driven:
    """A robot that is driven by hand."""

    def __init__(self, drive: HandDrive) -> None:
        self.drive = drive
        self._stage = _Stage(drive.scene)
        self._last: Wanted | None = None

    def answer(self, wanted: Wanted, seconds: float) -> bytes | None:
        """The scene after the robot has driven on."""
        drive, drive.wish = self.drive, wanted.wish
        moved = drive.step(seconds)
        if not moved and wanted == self._last:
            return None
        self._last = wanted
        moment = drive.moment()
        words: dict[str, Any] = _pose_words(moment, drive.turning)
        words["beams"] = _scan_words(drive.scan.ranges, scanning=True)
        words["map"] = drive.counts
        words["stop"] = "a wall is in the way" if drive.bumped else ""
        return self._stage.message(moment, wanted, words)


def setup_of(scene: Scene, views: tuple[str, ...], *, end: float) -> dict[str, Any]:
    """What a page is given once, as values for JSON; a drive has no end."""
    speed = scene.timeline.playback
    before, after = margins("story")
    indoor = scene.structures.indoor
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
        "indoor": indoor,
        "roof": float(scene.structures.heights.max(initial=0.0)),
        "haze": look.HAZE_INDOOR if indoor else look.HAZE,
        "zenith": look.ZENITH,
        "ghost": [*look.GHOST, look.GHOST_STRENGTH],
        "standing": look.LEFT_STANDING,
        "dash": look.DASH,
        "halo": [look.POINT_HALO, look.POINT_HALO_STRENGTH],
        "plan": [part / 255 for part in look.PLAN_BACK],
        "trail": trail,
        "estimate": estimate,
    }
