"""Origin: what a simulation is made of, by which a recording knows whether it is the same one."""

import hashlib
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.steering import Recorded, Steered

if TYPE_CHECKING:
    from lrf3d.steps import Simulation


def origin_of(simulation: "Simulation", about: Mapping[str, str]) -> dict[str, str]:
    """What a simulation is made of: a digest or a name of each part."""
    world, drive = simulation.world, simulation.drive
    if isinstance(drive, Recorded):
        drive_parts: list[Any] = [drive.trajectory.times, drive.trajectory.poses]
    else:
        assert isinstance(drive, Steered)
        drive_parts = [_name_of(drive.controller), drive.start, drive.interval, drive.radius]
    movers = [
        part
        for mover in simulation.movers
        for part in (mover.outline, mover.height, mover.path.times, mover.path.poses)
    ]
    parts = {
        "world": _digest(world.segments, world.objects, world.heights, world.colours, world.name),
        "range finder": _digest(simulation.lrf),
        "drive": _digest(*drive_parts),
        "scans": str(simulation.scans),
        "movers": _digest(*movers),
        "noise": _name_of(simulation.noise),
        "mapper": _name_of(simulation.mapper),
        "seed": _digest(json.dumps(_plain(simulation.rng), sort_keys=True)),
    }
    return {**parts, **about}


def _plain(rng: np.random.Generator) -> dict[str, Any]:
    """The state of random numbers in JSON's types.

    Raises:
        InputError: JSON cannot hold it.
    """
    state = dict(rng.bit_generator.state)
    try:
        json.dumps(state)
    except TypeError:
        kind = type(rng.bit_generator).__name__
        raise InputError(
            f"rng with {kind}: its state cannot be saved; use numpy.random.default_rng"
        ) from None
    return state


def _name_of(part: Any) -> str:
    """The repr of a part, or its class if the repr holds no more than its address."""
    text = repr(part)
    kind = f"{type(part).__module__}:{type(part).__qualname__}"
    return kind if " at 0x" in text else f"{kind} {text}"


def _digest(*parts: Any) -> str:
    digest = hashlib.sha256()
    for part in parts:
        array = isinstance(part, np.ndarray)
        said = part.tobytes() if array else repr(part).encode()
        digest.update(len(said).to_bytes(8, "little") + said)
    return digest.hexdigest()[:16]
