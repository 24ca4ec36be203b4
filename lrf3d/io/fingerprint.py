"""The fingerprint of a run: by it a resumed simulation recognises its own journal."""

from typing import Any

from lrf3d.digest import digest, name_of
from lrf3d.io.journal import rng_state
from lrf3d.robot import Trajectory
from lrf3d.simulation import Simulation


def fingerprint_of(simulation: Simulation) -> dict[str, str]:
    """A digest or a name of each part of a simulation, at its beginning.

    Raises:
        InputError: The state of its random numbers cannot be saved.
    """
    world, drive = simulation.world, simulation.drive
    noise: Any = simulation.sensor.noise
    path: list[Any]
    if isinstance(drive, Trajectory):
        path = [drive.times, drive.poses]
    else:
        path = [name_of(drive.controller), drive.start, drive.interval, drive.radius]
    parts = {
        "world": [
            world.segments,
            world.objects,
            world.heights,
            world.colours,
            world.name,
            world.materials,
        ],
        "range finder": simulation.lrf,
        "drive": path,
        "dynamic obstacles": [
            [each.outline, each.height, each.poses.times, each.poses.poses]
            for each in simulation.obstacles
        ],
        "seed": rng_state(simulation.rng).decode(),
    }
    return {
        **{name: digest(part)[:16] for name, part in parts.items()},
        "scans": str(simulation.scans),
        "caster": type(simulation.sensor.caster).__name__,
        "noise": name_of(noise),
        "mapper": name_of(simulation.mapper),
    }
