"""The cameras of films by their names, and the times of the run that their films show."""

from collections.abc import Callable

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.studio.scene.camera import Camera
from lrf3d.studio.scene.cameras import First, Fixed, chase, orbit, overview, top
from lrf3d.studio.scene.shots import CLOSING, LENGTH, plan_shots, run_times
from lrf3d.studio.scene.stage.stage import Stage
from lrf3d.studio.scene.stage.structures import Structures
from lrf3d.studio.scene.story import Story
from lrf3d.studio.scene.timeline import Timeline

# The cameras that every world has, except the story.
_CAMERAS: dict[str, Callable[[Timeline, Structures], Camera]] = {
    "chase": chase,
    "first": First,
    "orbit": orbit,
    "overview": overview,
    "top": top,
}


def make_camera(view: str, timeline: Timeline, stage: Stage, length: float | None) -> Camera:
    """Make the camera of a name for a run: one that every world has, or a fixed one of this world.

    A story has a length [s of the film], 15 if it is None.
    """
    if view == "story":
        return Story(timeline, stage.structures, stage.exposure, length or LENGTH)
    if view in _CAMERAS:
        return _CAMERAS[view](timeline, stage.structures)
    return Fixed(next(c for c in timeline.run.world.cameras if c.name == view), timeline)


def margin(view: str) -> float:
    """Duration of a film after the run has ended [s of the film]."""
    return CLOSING if view == "story" else 0.0


def film_times(view: str, timeline: Timeline, fps: float, length: float | None) -> Float:
    """The times (n,) of the run [s] that a film's frames show; a story has a length [s]."""
    if view != "story":
        return timeline.frame_times(fps)
    shots = plan_shots(timeline, length or LENGTH)
    frames = np.floor(sum(shot.length for shot in shots) * fps)
    return run_times(shots, np.arange(frames + 1.0) / fps)
