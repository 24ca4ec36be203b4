"""A yard with a shed, as a world file; what moves in it, and drives through it."""

from lrf3d.simulation.scenario import load_scenario
from lrf3d.studio.page.hand_drive import HandDrive

YARD = """\
name = "yard"

[[object]]
name = "walls"
points = [[0, 0], [16, 0], [16, 9], [0, 9]]
closed = true

[[object]]
name = "shed"
points = [[6, 6], [8, 6], [8, 8], [6, 8]]
closed = true

[robot]
route = [[2, 3], [13, 3]]
speed = 2.0

[laser]
beams = 61
range_max = 30.0
"""
OBSTACLE = """
[[obstacle]]
route = [[9, 2], [9, 7]]
radius = 0.4
"""


def hand(text, folder, **settings):
    """A drive by hand through a world file of this text."""
    path = folder / "world.toml"
    path.write_text(text)
    return HandDrive(load_scenario(path), **settings)
