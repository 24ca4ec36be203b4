"""A world with the robot in it as glTF, for pages that move it themselves."""

from lrf3d.gltf.robot import add_robot
from lrf3d.gltf.stage import add_stage, new_document
from lrf3d.render.structures import Structures
from lrf3d.world import World


def still_glb(world: World, structures: Structures, laser_height: float) -> bytes:
    """A world and the robot, which stands in the world's origin, as a GLB file."""
    document = new_document(world)
    add_stage(document, structures)
    add_robot(document, laser_height)
    return document.glb()
