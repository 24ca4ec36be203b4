"""Ranges of beams that deviate from their nominal angles, compiled.

True scans of one range finder and deviations enter, by rows; ranges leave.
"""

import math

from lrf3d.compiling import compiled
from lrf3d.geometry.lines import Float, Int


@compiled
def ranges_aside(
    beams: Float, sines: Float, draws: Float, ranges: Float, walls: Int, found: Float
) -> None:
    """Fill in ranges (k, beams) at angles that deviate by draws from those of the beams.

    The angles of the beams (beams,) ascend; the sines (beams − 1,) are those of the angles between
    them.
    """
    last = len(beams) - 1
    for k in range(len(ranges)):
        for i in range(len(beams)):
            angle = beams[i] + draws[k, i]
            # Most angles lie between the beam and its neighbours.
            after = i + int(angle > beams[i])
            while after <= last and beams[after] < angle:
                after += 1
            while after > 0 and beams[after - 1] >= angle:
                after -= 1
            after = min(max(after, 1), last)
            before = after - 1
            turn = beams[after] - beams[before]
            ahead = min(max(angle - beams[before], 0.0), turn)
            near = ranges[k, before]
            far = ranges[k, after]
            found[k, i] = far if 2.0 * ahead > turn else near
            on_wall = walls[k, before] == walls[k, after] >= 0
            # At the beams themselves the measured ranges are kept, to the last bit.
            if on_wall and 0.0 < ahead < turn and math.isfinite(near) and math.isfinite(far):
                opposite = near * math.sin(ahead) + far * math.sin(turn - ahead)
                found[k, i] = near * far * sines[before] / opposite
