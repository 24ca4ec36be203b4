"""A beam that a mirror turns, and where the laser takes it to have gone: straight on.

A scan, the mirrors and a place behind one enter; lines in the film's frame leave.
"""

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.laser import LaserScan
from lrf3d.studio.scene import look
from lrf3d.studio.scene.shapes import Lines, level_lines
from lrf3d.studio.scene.stage.structures import folded

# Colour of the beam.
TURNED_COLOUR = look.rgb("#fff2cc")


def bounced(
    scan: LaserScan, mirrors: Float, apex: Float, aim: Float, height: float
) -> Lines | None:
    """The beam of which the laser takes the end to be nearest to an aim (2,) behind a mirror.

    The pose of the scan, the mirrors (m, 4) and the apex (2,), where the beam begins, are in the
    film's frame. None where no beam is turned.
    """
    ends = scan.points()
    legs, beams, _ = folded(np.array(scan.pose[:2]), ends, mirrors)
    turned = np.flatnonzero(np.bincount(beams) > 1)
    if not len(turned):
        return None
    best = turned[np.argmin(np.hypot(*(ends[turned] - aim).T))]
    legs = legs[beams == best]
    legs[0, :2] = apex
    way = np.vstack([legs, [*legs[0, 2:], *ends[best]]])
    colours = np.array([*[TURNED_COLOUR] * len(legs), look.FALSE_COLOUR])
    starts, stops = np.hsplit(way, 2)
    return level_lines(height, starts, stops, colours, np.ones((len(way), 2)), look.BOLD)
