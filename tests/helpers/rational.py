"""One beam by rational numbers."""

from collections.abc import Sequence
from fractions import Fraction

from lrf3d.casting.exact import ExactWorld
from lrf3d.geometry import Float


def cast_exact(
    segments: Float, origin: Sequence[float], direction: Sequence[float]
) -> tuple[int, Fraction | None]:
    """Cast one beam against segments (n, 4); of segments at equal t the lowest index counts.

    Returns:
        The wall and t in units of the direction's length, or −1 and None where nothing is hit.
    """
    return ExactWorld(segments, [origin]).cast(0, direction)
