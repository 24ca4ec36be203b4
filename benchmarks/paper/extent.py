"""How much is measured for the page of the paper."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Extent:
    """How much is measured.

    Args:
        seeds: Seeds of the noise in the room.
        city_seeds: Seeds in the city, whose runs take longer.
        every: Of so many scans of the city one is used where noises are varied.
        scans: Scans of the drive through the city at most; all where None.
        towns: Walls of the towns in which lines are paired, beside the city.
        robots: Seeds of the robot that finds itself.
        film: Width and height of the frame of the film [pixels].
    """

    seeds: int = 20
    city_seeds: int = 5
    every: int = 8
    scans: int | None = None
    towns: tuple[int, ...] = (1_000, 10_000)
    robots: int = 5
    film: tuple[int, int] = (1600, 900)
