"""What lidars hit, as points coloured by height or intensity; a few thousand of them.

The scans of lidars enter; points in the film's frame leave, where each column of beams was sent
from. Layers stay whole, so that walls light up band by band.
"""

from collections.abc import Iterable

import numpy as np

from lrf3d.casting.skyline import swept
from lrf3d.geometry.lines import TINY, Float
from lrf3d.laser import LidarScan
from lrf3d.studio.scene.look import gradient, rgb
from lrf3d.studio.scene.shapes import Points, single

# Colours of points from the floor to the top.
HEIGHT_COLOURS = np.array([rgb(code) for code in ("#294dbf", "#1abfb8", "#ffcc59")])

# Largest height with a colour of its own [m]: streets are higher.
TOP = 4.0

# Number of layers that are drawn of a lidar.
LAYERS = 16

# Diameter of a point [m].
SIZE = 0.05

# Its smallest and largest diameter [pixels of 720 lines].
PIXELS = (1.8, 4.5)


def draw_clouds(
    scans: Iterable[LidarScan], origin: Float, most: int, high: float, by: str = "range"
) -> Points | None:
    """Points below a height [m], of some beams of each scan, with the film's origin (2,).

    They are coloured by their height, or by their intensity.
    """
    parts = [_points(scan, most, by) for scan in scans]
    if not parts:
        return None
    rows = np.concatenate(parts)
    rows = rows[rows[:, 2] < high]
    places = rows[:, :3] - [*origin, 0.0]
    # Intensities span four powers of ten, as those of hits of range finders do.
    top = min(TOP, high)
    share = 1.0 + 0.25 * np.log10(rows[:, 3]) if by == "intensity" else places[:, 2] / top
    colours = np.insert(gradient(share, HEIGHT_COLOURS), 3, 1.0, axis=1)
    sides = np.zeros((len(places), 2))
    return Points(single(places), single(colours), single(sides), SIZE, PIXELS, glows=False)


def _points(scan: LidarScan, most: int, by: str) -> Float:
    """Points in the world of some layers and columns of a scan, with their intensities (n, 4)."""
    lidar = scan.lidar
    pose = np.array(scan.pose)
    still = scan.motion is None or not np.any(scan.motion)
    poses = pose[None] if still else swept(lidar, pose, np.asarray(scan.motion))
    layers = slice(None, None, max(1, len(lidar.elevations) // LAYERS))
    shown = len(lidar.elevations[layers])
    columns = slice(None, None, max(1, lidar.columns * shown // most))
    beams = lidar.directions((0.0, 0.0, 0.0))[layers, columns]
    ranges = np.where(scan.hits, scan.ranges, 0.0)[layers, columns, None]
    x, y, z = np.moveaxis(ranges * beams, 2, 0)
    place_x, place_y, theta = np.broadcast_to(poses, (lidar.columns, 3))[columns].T
    cos: Float = np.cos(theta)
    sin: Float = np.sin(theta)
    places = place_x + cos * x - sin * y, place_y + sin * x + cos * y, lidar.mount[2] + z
    light = np.maximum(scan.intensities[layers, columns], TINY) if by == "intensity" else z
    return np.stack([*places, light], axis=2)[scan.hits[layers, columns]]
