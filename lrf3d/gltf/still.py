"""A world with robot and dynamic obstacles as glTF, for pages that move them themselves."""

from typing import TYPE_CHECKING

from lrf3d.gltf.movers import add_movers
from lrf3d.gltf.robot import add_robot
from lrf3d.gltf.stage import add_stage, new_document
from lrf3d.render.structures import Structures

if TYPE_CHECKING:
    from lrf3d.casting.mover import Mover


def still_glb(
    name: str,
    structures: Structures,
    laser_height: float,
    movers: "tuple[Mover, ...]" = (),
) -> bytes:
    """A world as a GLB file, with the robot and dynamic obstacles, all at the frame's origin."""
    document = new_document(name, structures)
    add_stage(document, structures)
    add_robot(document, laser_height)
    add_movers(document, movers)
    return document.glb()
