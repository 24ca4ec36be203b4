"""What stands in a run's world, painted and lit once for all pictures of it.

A run enters; faces and ground in their light leave. Baking that light takes seconds, so a stage is
kept: the one asked for last in memory, and those that took long in the user's cache folder, where
the next film of the same walls finds it. A stage can be pickled, to be handed to other processes.
"""

import hashlib
import os
import pickle
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import fields
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely

from lrf3d.casting.triangle_rays import embreex_installed
from lrf3d.errors import OutputError
from lrf3d.output import make_folder, replacing
from lrf3d.progress import Progress, silent
from lrf3d.run import Run
from lrf3d.scene.ground import Ground, paint_ground
from lrf3d.scene.structures import Structures
from lrf3d.scene.walls import PaintedWalls, paint_walls

_GROUND_SHARE = 0.25
"""What the ground takes of a bake, against the walls."""

_WORTH_KEEPING = 0.3
"""Seconds of work from which on a stage is kept on disk: small rooms are painted as fast."""

_MOST_KEPT = 256_000_000
"""Bytes of all stages on disk; that of the city takes 14 million. The oldest go first."""


class Stage(NamedTuple):
    """What stands in a world.

    Args:
        structures: What its walls make up.
        walls: Walls and roofs in their light.
        ground: The ground in its light.
    """

    structures: Structures
    walls: PaintedWalls
    ground: Ground


_PARTS = {
    ("lrf3d.casting.triangle_rays", "TriangleRays"),
    ("numpy", "ndarray"), ("numpy", "dtype"), ("numpy._core.multiarray", "_reconstruct"),
    ("numpy._core.numeric", "_frombuffer"), ("numpy._core.multiarray", "scalar"),
}  # fmt: skip
"""What stages are made of besides the classes of scenes: the rays of their light, and arrays."""


def stage_of(run: Run, progress: Progress = silent) -> Stage:
    """Paint what can be seen of a run's world, or find it painted.

    Args:
        run: The run.
        progress: Called with finished steps and their number while the light is baked.
    """
    kept = _in_memory(run)
    if kept:
        return kept[0]
    structures = Structures.from_run(run)
    place = _place(structures)
    stage = _read(place, structures)
    if stage is None:
        began = time.process_time()
        stage = _paint(structures, progress)
        if time.process_time() - began > _WORTH_KEEPING:
            _keep(place, stage)
    kept.append(stage)
    return stage


@lru_cache(maxsize=1)
def _in_memory(run: Run) -> list[Stage]:
    """The stage of the run asked for last, once there is one."""
    return []


def _paint(structures: Structures, progress: Progress) -> Stage:
    whole = 1

    def report(done: int, total: int) -> None:
        nonlocal whole
        whole = total + max(1, round(_GROUND_SHARE * total))
        progress(done, whole)

    walls = paint_walls(structures, progress=report)
    ground = paint_ground(structures, walls.light)
    progress(whole, whole)
    return Stage(structures, walls, ground)


def _place(structures: Structures) -> Path:
    """The file that a stage is kept in: its name says of what walls, and painted by what code."""
    digest = hashlib.sha256(_stamp())
    for field in fields(structures):
        value = getattr(structures, field.name)
        solids = field.name == "solids"
        array = np.ascontiguousarray(shapely.to_wkb(value) if solids else value)
        digest.update(f"{field.name} {array.shape}".encode())
        digest.update(b"".join(array.tolist()) if solids else array.tobytes())
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(home) / "lrf3d" / f"{digest.hexdigest()[:32]}.stage"


@cache
def _stamp() -> bytes:
    """What changes with the code of this package: its files, their sizes and times."""
    package = Path(__file__).parents[1]
    stamps: list[object] = [np.__version__, shapely.__version__, embreex_installed()]
    for file in sorted(package.rglob("*.py")):
        seen = file.stat()
        stamps.append((str(file.relative_to(package)), seen.st_size, seen.st_mtime_ns))
    return repr(stamps).encode()


class _PartsOnly(pickle.Unpickler):
    """Reads arrays and what scenes are made of; a file that names anything else is not followed."""

    def find_class(self, module: str, name: str) -> Any:
        """A class of a scene, or one of the few other parts."""
        if (module, name) in _PARTS:
            return super().find_class(module, name)
        if module.startswith("lrf3d.scene."):
            found = super().find_class(module, name)
            if isinstance(found, type) and found.__module__ == module:
                return found
        raise pickle.UnpicklingError(f"{module}.{name} is no part of a stage")


def _read(place: Path, structures: Structures) -> Stage | None:
    """A stage that was kept, or None; one that cannot be read is painted again."""
    try:
        with place.open("rb") as file:
            walls, ground = _PartsOnly(file).load()
        os.utime(place)
    except Exception:
        # A damaged pickle can raise anything.
        return None
    return Stage(structures, walls, ground)


def _keep(place: Path, stage: Stage) -> None:
    """Keep a stage, where files can be written, and remove the oldest ones."""
    with suppress(OutputError, OSError):
        make_folder(place.parent)
        with replacing(place) as unfinished:
            unfinished.write_bytes(pickle.dumps((stage.walls, stage.ground), 5))
        for old in _beyond(place.parent, _MOST_KEPT):
            old.unlink(missing_ok=True)


def _beyond(folder: Path, most: int) -> Iterator[Path]:
    """The stages in a folder that are too many [bytes], those used longest ago."""
    found = [(file, file.stat()) for file in folder.glob("*.stage")]
    total = 0
    for file, seen in sorted(found, key=lambda each: -each[1].st_mtime_ns):
        total += seen.st_size
        if total > most:
            yield file
