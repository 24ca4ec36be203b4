"""The cameras of a film by name: those of every world, and fixed ones that a world has."""

from collections.abc import Callable

from lrf3d.scene.camera import Camera
from lrf3d.scene.following import First, Fixed, chase, orbit
from lrf3d.scene.story import CLOSING, OPENING, Story
from lrf3d.scene.structures import Structures
from lrf3d.scene.timeline import Timeline
from lrf3d.scene.whole import overview, top
from lrf3d.world.cameras import check_view

CAMERAS: dict[str, Callable[[Timeline, Structures], Camera]] = {
    "chase": chase,
    "first": First,
    "orbit": orbit,
    "overview": overview,
    "story": Story,
    "top": top,
}


def margins(view: str) -> tuple[float, float]:
    """How long a film goes on before the run starts and after it has ended [s of the film]."""
    return (OPENING, CLOSING) if view == "story" else (0.0, 0.0)


def make_camera(view: str, timeline: Timeline, structures: Structures) -> Camera:
    """Make the camera of a name for a run, and what stands in its world.

    Raises:
        InputError: There is no camera of that name.
    """
    world = timeline.run.world
    check_view(view, world.cameras)
    if view in CAMERAS:
        return CAMERAS[view](timeline, structures)
    return Fixed(next(c for c in world.cameras if c.name == view), timeline)
