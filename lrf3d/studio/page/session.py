"""What one page sees: a run that is played, or a drive by hand, as messages for the page.

The page asks for a time and a view, or for speeds to drive at; the scene of that moment leaves.
"""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from lrf3d.simulation.run import Run
from lrf3d.studio.page.hand_drive import DriveTimeline, HandDrive
from lrf3d.studio.page.message import Part, Sender, part_of, times_part
from lrf3d.studio.scene import look
from lrf3d.studio.scene.camera import Camera, CameraPath, Look, PathCamera, SmoothPath
from lrf3d.studio.scene.cameras import First, behind, chase, overview, top
from lrf3d.studio.scene.marks import TRUTH, estimate_words
from lrf3d.studio.scene.moments import Scene
from lrf3d.studio.scene.panel import panel
from lrf3d.studio.scene.shapes import Inset, Lens, Seen
from lrf3d.studio.scene.stage.stage import Stage
from lrf3d.studio.scene.story import Story
from lrf3d.studio.scene.timeline import Moment, Timeline
from lrf3d.studio.scene.views import margin

# A time [s] and a number of drives that no page gets to.
_EVER = 1e9

# Sides of pictures that are drawn for a page [pixels].
_SIDES = (16.0, 8192.0)

# In place of a heading [rad] for none: more than half a turn.
_NO_HEADING = 9.0

# The least and the largest of the numbers that a page sends, by the fields of `Wanted`.
_LIMITS = {
    "time": (-_EVER, _EVER),
    "width": _SIDES,
    "height": _SIDES,
    "forward": (-1.0, 1.0),
    "turn": (-1.0, 1.0),
    "drive": (0.0, _EVER),
    "goal": (0.0, _EVER),
    "x": (-_EVER, _EVER),
    "y": (-_EVER, _EVER),
    "heading": (-_NO_HEADING, _NO_HEADING),
}

# Half the time over which the robot's turn is measured [s].
_TURN_STEP = 0.05


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a page wants to see and do.

    Args:
        view: The name of a camera.
        time: Time since the start of the run [s]; a story begins before the start and goes on after
            the end.
        width: Width of the part of the picture that no controls cover [pixels].
        height: Its height [pixels].
        forward: Share of the robot's highest speed.
        turn: Share of its highest turn rate.
        drive: Number of the drive; a new number starts again.
        goal: Number of the goal; with a new number the robot drives to the goal.
        x: Position of the goal, relative to the middle of the world [m].
        y: Likewise.
        heading: The heading there [rad]; 9 for any.
    """

    view: str = "follow"
    time: float = 0.0
    width: float = look.SIZE[0]
    height: float = look.SIZE[1]
    forward: float = 0.0
    turn: float = 0.0
    drive: float = 0.0
    goal: float = 0.0
    x: float = 0.0
    y: float = 0.0
    heading: float = _NO_HEADING

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


# Factor of speed at which the parts that a story leaves out pass: at once.
_SKIPPED = 1e9

# The words of a panel for a moment and a look.
Said = Callable[[Moment, Look], str]


class PageSession:
    """A scene as one page sees it, of a run that is played or of a drive by hand."""

    def __init__(
        self,
        scene: Scene,
        cameras: Mapping[str, Camera],
        *,
        drive: HandDrive | None = None,
        said: Said = lambda moment, view: "",
        sender: Sender | None = None,
    ) -> None:
        self.scene = scene
        self.drive = drive
        place = scene.timeline, scene.structures
        self.cameras: dict[str, Camera] = {
            **cameras, "orbit": overview(*place), "top": top(*place), "first": First(*place),
        }  # fmt: skip
        self._said = said
        self._sender = sender or Sender()
        self._last: Wanted | None = None
        self._inset = scene.inset_view()
        self._goal = 0.0

    @classmethod
    def played(cls, run: Run, playback: float, sender: Sender | None = None) -> "PageSession":
        """A run that is played."""
        scene = Scene(Timeline(run, playback=playback))
        place = scene.timeline, scene.structures
        cameras: dict[str, Camera] = {
            "story": Story(*place, scene.exposure),
            "follow": chase(*place),
        }

        def said(moment: Moment, view: Look) -> str:
            return panel(run, moment, view, playback).text[0]

        return cls(scene, cameras, said=said, sender=sender)

    @classmethod
    def driven(cls, drive: HandDrive, stage: Stage | None = None) -> "PageSession":
        """A robot that is driven by hand, which is followed as the film's camera does it."""
        scene = Scene(DriveTimeline(drive), stage=stage, live=True)
        structures = scene.structures

        def track(aspect: float) -> CameraPath:
            places = np.array([drive.robot.pose[:2]]) - scene.origin
            now = SmoothPath(np.zeros(1), places, np.array([drive.facing]))
            return behind(now, structures.setting.chase).past_walls(structures, places, 1.0)

        return cls(scene, {"follow": PathCamera(track, {"cuts": True})}, drive=drive)

    def setup(self) -> dict[str, Any]:
        """What a page is given once, as values for JSON; a drive has no end.

        The names also fill the gaps in the page's HTML; the inset's scale is a bar of some metres,
        and its share of the inset's width [%].
        """
        timeline = self.scene.timeline
        drive = self.drive
        end = 0.0 if drive else timeline.end - timeline.start
        inset = self._inset
        return {
            "title": timeline.run.world.name or (drive.name if drive else "run"),
            "mode": "drives" if drive else "plays",
            "end": end,
            "story": [0.0, end + timeline.playback * margin("story")],
            "rates": self._rates(),
            "speed": timeline.playback,
            "trail": _legend(look.TRAIL_COLOUR),
            "estimate": _legend(look.ESTIMATE_COLOUR),
            "metres": f"{inset.bar:g}",
            "share": 100.0 * inset.bar / inset.width,
            "aspect": 1.0 / inset.aspect,
        }

    def _rates(self) -> list[tuple[float, float, float]]:
        """The periods [s] that a story passes faster than its playback, with their factors."""
        story = self.cameras.get("story")
        if not isinstance(story, Story):
            return []
        timeline = self.scene.timeline
        found = []
        for before, shot in pairwise(story.shots):
            rate = (shot.end - shot.start) / (shot.length * timeline.playback)
            found.append((before.end, shot.start, _SKIPPED))
            found.append((shot.start, shot.end, rate))
        return [
            (begin - timeline.start, end - timeline.start, rate)
            for begin, end, rate in found
            if end > begin and rate > 1.0
        ]

    def answer(self, wanted: Wanted, seconds: float) -> bytes | None:
        """The message for a page that wants this, after some seconds; None if it has all."""
        moved = self._drive_on(wanted, seconds)
        if not moved and wanted == self._last:
            return None
        self._last = wanted
        scene = self.scene
        moment = scene.timeline.moment(scene.timeline.start + wanted.time)
        size = (round(wanted.width), round(wanted.height))
        camera = self.cameras.get(wanted.view, self.cameras["follow"])
        view = camera.look(moment.now, size[0] / size[1])
        seen = scene.seen(moment, view, size)
        plan = scene.inset(moment, self._inset) if view.inset else None
        values = {
            "camera": {
                **_camera(seen.lens),
                **{name: getattr(seen, name) for name in ("clock", "dusk", "cut")},
                "target": _numbers(view.target),
            },
            "size": size,
            "plan": _camera(plan.lens) if plan else None,
            "tints": None,
            "words": self._words(moment, view),
        }
        if seen.tints is not None:
            flat = seen.tints.lens
            values["tints"] = {**_camera(flat), "matrix": _numbers(flat.matrix)}
        return self._sender.message(self._parts(seen, plan), values)

    def _drive_on(self, wanted: Wanted, seconds: float) -> bool:
        """Drive on by hand for a time [s]; false where all stands still, or a run is played."""
        if self.drive is None or self.scene.live is None:
            return False
        if wanted.goal not in (0.0, self._goal):
            self._goal = wanted.goal
            place = np.array([wanted.x, wanted.y]) + self.scene.origin
            self.drive.go_to(place, None if wanted.heading == _NO_HEADING else wanted.heading)
        moved = self.drive.step(seconds, wanted.forward, wanted.turn)
        self.scene.live.see(self.drive.latest, self.drive.robot.time)
        if moved:
            self.scene.keys = self.drive.trajectory.keys(self.scene.origin)
        return moved

    def _parts(self, seen: Seen, plan: Inset | None) -> dict[str, Part]:
        """The parts of a message, in the order in which they are drawn."""
        parts = dict[str, Part]()
        for name, body in seen.bodies:
            style, columns = part_of(body.faces)
            parts[name] = {**style, "pose": _numbers(body.pose)}, columns
        marks = seen.marks if plan is None else (*seen.marks, *plan.marks)
        parts |= {name: part_of(mark) for name, mark in marks}
        if seen.tints is not None:
            parts["tints"] = part_of(seen.tints.lines)
        live = self.scene.live
        fresh = None if live is None else live.fresh()
        if fresh is not None:
            parts["times"] = times_part(*fresh)
        return parts

    def _words(self, moment: Moment, view: Look) -> dict[str, str]:
        """What is shown, where the robot is, how it moves, what its laser sees, and the map."""
        run = self.scene.run
        timeline = self.scene.timeline
        x, y, theta = moment.pose
        before, after = timeline.poses(moment.time + np.array([-_TURN_STEP, _TURN_STEP]))[:, 2]
        turned = 0.0 if timeline.dwells else math.remainder(after - before, math.tau)
        ranges = run.scans_at(moment.scan)[0].ranges
        snapshot = run.snapshot_after(moment.mapped)
        hits = ranges[np.isfinite(ranges)]
        nearest = f"{hits.min():.2f} m" if len(hits) else "none"
        beams = f"{len(hits)} / {len(ranges)} beams hit, min {nearest}"
        stopped = "" if self.drive is None else self.drive.obstruction
        words = {
            "said": self._said(moment, view),
            "t": f"{moment.time:.1f}",
            "v": f"{moment.speed:z.2f}",
            "w": f"{math.degrees(turned / (2.0 * _TURN_STEP)):z.0f}",
            "x": f"{x:z.2f}",
            "y": f"{y:z.2f}",
            "theta": f"{math.degrees(math.remainder(theta, math.tau)):z.1f}",
            "beams": beams if moment.scanning else "beams off",
            "map": run.maps[snapshot].counts if snapshot >= 0 else "no map yet",
            "stop": stopped,
        }
        for name, apart in estimate_words(run, moment.scan):
            words["truth" if name == TRUTH else "believed"] = f"{name} {apart}".strip()
        return words


def _legend(colour: tuple[float, ...]) -> str:
    """A colour for text, paler on its dark ground."""
    return f"rgb({', '.join(f'{part:.0%}' for part in look.paler(colour))})"


def _camera(lens: Lens) -> dict[str, Any]:
    others = {"thick": lens.thick, "slack": lens.slack, "nearer": lens.nearer, "focus": lens.focus}
    # The first row of a browser's picture is the lower one.
    matrix = lens.matrix * np.array([[1.0], [-1.0], [1.0], [1.0]])
    return {"matrix": _numbers(matrix), "eye": _numbers(lens.eye), **others}


def _numbers(values: Any) -> list[float]:
    """Numbers for JSON, of matrices column by column, as exactly as float32 has them."""
    return [float(f"{value:.8g}") for value in np.asarray(values).T.ravel().tolist()]
