"""What a page shows: a run that is played, or a drive by hand, as messages for the page.

The page asks for a time and a view, or for speeds to drive at; the scene of that moment leaves.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lrf3d.simulation.run import Run
from lrf3d.studio.page.hand_drive import HandDrive
from lrf3d.studio.page.message import Part, Sender, part_of, times_part
from lrf3d.studio.scene import look
from lrf3d.studio.scene.camera import Camera, Look, SmoothPath, Track, Tracked
from lrf3d.studio.scene.cameras import First, Story, behind, chase, margins, overview, top
from lrf3d.studio.scene.marks import TRUTH, estimate_words
from lrf3d.studio.scene.moments import Scene
from lrf3d.studio.scene.panel import panel
from lrf3d.studio.scene.shapes import Lens
from lrf3d.studio.scene.stage.stage import Stage
from lrf3d.studio.scene.timeline import Moment, Timeline

# The least and the largest of the numbers that a page sends.
_LIMITS = {
    "time": (-1e9, 1e9),
    "width": (16, 8192),
    "height": (16, 8192),
    "forward": (-1.0, 1.0),
    "turn": (-1.0, 1.0),
    "drive": (0, 1e9),
}

# Width of the plan in the corner, as a share of the shorter side of the picture, and half the time
# [s] over which the turn is measured.
_PLAN_WIDTH = 0.3
_TURN_STEP = 0.05


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a page wants to see and do."""

    view: str = "follow"
    time: float = 0.0
    """Time from the start of the run on [s]; a story begins before it and goes on after its end."""
    width: float = 1280.0
    height: float = 720.0
    """Size of what of the picture no controls cover [pixels]."""
    forward: float = 0.0
    turn: float = 0.0
    drive: float = 0.0
    """Shares of the robot's highest speeds, and the number of the drive: another starts again."""

    def changed(self, text: str) -> "Wanted":
        """What is wanted after a message from the page; a malformed one changes nothing."""
        try:
            sent = json.loads(text)
            new = {name: float(sent.get(name, getattr(self, name))) for name in _LIMITS}
            view = str(sent.get("view", self.view))
        except (ArithmeticError, AttributeError, RecursionError, TypeError, ValueError):
            return self
        within = all(low <= new[name] <= high for name, (low, high) in _LIMITS.items())
        return Wanted(view, **new) if within else self


class Shown:
    """A scene as one page sees it, of a run that is played or of a drive by hand."""

    def __init__(
        self,
        scene: Scene,
        cameras: Mapping[str, Camera],
        drive: HandDrive | None = None,
        sender: Sender | None = None,
    ) -> None:
        self.scene = scene
        self.drive = drive
        timeline = scene.timeline
        structures = scene.structures
        self.cameras: dict[str, Camera] = {
            **cameras,
            "orbit": overview(timeline, structures),
            "top": top(timeline, structures),
            "first": First(timeline, structures),
        }
        self._sender = sender or Sender()
        self._last: Wanted | None = None
        self._window = scene.plan_window()

    @classmethod
    def played(cls, run: Run, playback: float, sender: Sender | None = None) -> "Shown":
        """A run that is played."""
        scene = Scene(Timeline(run, playback=playback))
        place = scene.timeline, scene.structures
        return cls(scene, {"story": Story(*place), "follow": chase(*place)}, sender=sender)

    @classmethod
    def driven(cls, drive: HandDrive, stage: Stage | None = None) -> "Shown":
        """A robot that is driven by hand, which is followed as the film's camera does it."""
        scene = Scene(drive, stage=stage, live=True)
        structures = scene.structures

        def track(aspect: float) -> Track:
            places = np.array([drive.robot.pose[:2]]) - scene.origin
            now = SmoothPath(np.zeros(1), places, np.array([drive.facing]))
            return behind(now, structures.setting.chase).past_walls(structures, places, 1.0)

        return cls(scene, {"follow": Tracked(track, {"cuts": True})}, drive)

    def setup(self) -> dict[str, Any]:
        """What a page is given once, as values for JSON; a drive has no end.

        The names also fill the gaps in the page's HTML; the plan's scale is a bar of some metres,
        and its share of the plan's width [%].
        """
        timeline = self.scene.timeline
        drive = self.drive
        before, after = margins("story")
        end = 0.0 if drive else timeline.end - timeline.start
        return {
            "title": timeline.run.world.name or (drive.name if drive else "run"),
            "mode": "drives" if drive else "plays",
            "end": end,
            "story": [-before * timeline.playback, end + after * timeline.playback],
            "speed": timeline.playback,
            "trail": _legend(look.TRAIL_COLOUR),
            "estimate": _legend(look.ESTIMATE_COLOUR),
            "metres": f"{self._window.bar:g}",
            "share": 100.0 * self._window.bar / self._window.width,
            "aspect": 1.0 / self._window.aspect,
        }

    def answer(self, wanted: Wanted, seconds: float) -> bytes | None:
        """The message for a page that wants this, after some seconds; None if it has all."""
        scene = self.scene
        drive = self.drive
        moved = drive is not None and drive.step(seconds, wanted.forward, wanted.turn)
        if drive is not None and scene.live is not None:
            scene.live.see(drive.latest, drive.robot.time)
        if not moved and wanted == self._last:
            return None
        self._last = wanted
        time = scene.timeline.start + wanted.time
        if drive is not None:
            time = drive.robot.time
            scene.keys = drive.driven()
        moment = scene.timeline.moment(time)
        size = (round(wanted.width), round(wanted.height))
        camera = self.cameras.get(wanted.view, self.cameras["follow"])
        view = camera.look(time, size[0] / size[1])
        seen = scene.seen(moment, view, size)
        parts = dict[str, Part]()
        plan = None
        for name, body in seen.bodies:
            style, columns = part_of(body.faces)
            parts[name] = {**style, "pose": _numbers(body.pose)}, columns
        marks = seen.marks
        if view.plan:
            wide = max(1, round(_PLAN_WIDTH * min(size)))
            box = (0, 0, wide, max(1, round(self._window.aspect * wide)))
            shown = scene.plan(moment, box, self._window)
            marks = (*marks, *shown.marks)
            plan = _camera(shown.lens)
        parts |= {name: part_of(mark) for name, mark in marks}
        values = {
            "camera": {
                **_camera(seen.lens),
                "clock": seen.clock,
                "glass": seen.glass,
                "robot": seen.robot,
                "cut": seen.cut,
                "target": _numbers(view.target),
            },
            "size": size,
            "plan": plan,
            "tints": None,
            "words": self._words(moment, view),
        }
        if seen.tints is not None:
            flat = seen.tints.lens
            parts["tints"] = part_of(seen.tints.lines)
            values["tints"] = {**_camera(flat), "matrix": _numbers(flat.matrix)}
        if scene.live and (fresh := scene.live.fresh()) is not None:
            parts["times"] = times_part(*fresh)
        return self._sender.message(parts, values)

    def _words(self, moment: Moment, view: Look) -> dict[str, str]:
        """What is shown, where the robot is, how it moves, what its laser sees, and the map."""
        run = self.scene.run
        timeline = self.scene.timeline
        x, y, theta = moment.pose
        before, after = timeline.poses(moment.time + np.array([-_TURN_STEP, _TURN_STEP]))[:, 2]
        turned = 0.0 if timeline.dwells else math.remainder(after - before, math.tau)
        ranges = run.scan(moment.scan).ranges
        stage = run.snapshot_after(moment.mapped)
        hits = ranges[np.isfinite(ranges)]
        nearest = f"{hits.min():.2f} m" if len(hits) else "none"
        beams = f"{len(hits)} / {len(ranges)} beams hit, min {nearest}"
        bumped = self.drive is not None and self.drive.robot.bumped
        words = {
            "said": "" if self.drive else panel(run, moment, view, timeline.playback).text[0],
            "t": f"{moment.time:.1f}",
            "v": f"{moment.speed:z.2f}",
            "w": f"{math.degrees(turned / (2.0 * _TURN_STEP)):z.0f}",
            "x": f"{x:z.2f}",
            "y": f"{y:z.2f}",
            "theta": f"{math.degrees(math.remainder(theta, math.tau)):z.1f}",
            "beams": beams if moment.scanning else "beams off",
            "map": run.maps[stage].counts if stage >= 0 else "no map yet",
            "stop": "a wall is in the way" if bumped else "",
        }
        for name, apart in estimate_words(run, moment.scan):
            words["truth" if name == TRUTH else "believed"] = f"{name} {apart}".strip()
        return words


def _legend(colour: tuple[float, ...]) -> str:
    """A colour for text, paler on its dark ground."""
    return f"rgb({', '.join(f'{100.0 * part:.0f}%' for part in look.paler(colour))})"


def _camera(lens: Lens) -> dict[str, Any]:
    others = {"thick": lens.thick, "slack": lens.slack, "nearer": lens.nearer, "focus": lens.focus}
    # The first row of a browser's picture is the lower one.
    matrix = lens.matrix * np.array([[1.0], [-1.0], [1.0], [1.0]])
    return {"matrix": _numbers(matrix), "eye": _numbers(lens.eye), **others}


def _numbers(values: Any) -> list[float]:
    """Numbers for JSON, of matrices column by column, as exactly as float32 has them."""
    return [float(f"{value:.8g}") for value in np.asarray(values).T.ravel().tolist()]
