"""Reading a world in a separate process, with limits on its time and its memory.

Libraries for drawings and meshes trust the contents of a file, which may be damaged or hostile. A
separate process can be stopped. It returns plain arrays; nothing is executed or unpickled.
"""

import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from lrf3d.errors import WorldError
from lrf3d.world.materials import material_of, material_value
from lrf3d.world.model import World

SECONDS, SECONDS_A_MEGABYTE = 4.0, 1.5
"""Limit of the processor time [s]: a constant part, and one for each megabyte of the file."""

SLOWEST_MACHINE = 10.0
"""Factor between the limits of wall time and processor time, for busy machines."""

MEMORY, MEMORY_A_BYTE = 300 << 20, 30
"""Limit of the memory [bytes]: a constant part, and one for each byte of the file."""

WALLS = np.dtype([("segment", "<f8", 4), ("object", "<i8"), ("height", "<f8")])


def read_apart(path: Path, read: Callable[[Path], World]) -> World:
    """Read a world in a process of its own.

    Args:
        path: The file.
        read: The function of a module that reads it.

    Raises:
        WorldError: The file cannot be used, or takes too long or too much memory to read.
    """
    seconds = _seconds(path)
    home = str(Path(__file__).parents[2])
    search = os.pathsep.join(filter(None, [home, os.environ.get("PYTHONPATH")]))
    environment = os.environ | {"PYTHONPATH": search, "OPENBLAS_NUM_THREADS": "1"}
    reader = [read.__module__, read.__qualname__]
    command = [sys.executable, "-P", "-m", "lrf3d.world.apart", *reader, str(path)]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=SLOWEST_MACHINE * seconds,
            env=environment,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise WorldError(_too_long(path, SLOWEST_MACHINE * seconds)) from None
    if done.returncode == -getattr(signal, "SIGXCPU", 0):
        raise WorldError(_too_long(path, seconds))
    header, _, body = done.stdout.partition(b"\n")
    if done.returncode != 0 or not header:
        raise WorldError(f"{path}: damaged, or needs too much memory to read")
    fields: dict[str, Any] = json.loads(header)
    if "error" in fields:
        raise WorldError(fields["error"])
    walls = np.frombuffer(body, dtype=WALLS)
    return World(
        walls["segment"],
        walls["object"],
        walls["height"],
        fields["name"],
        object_names=fields["object_names"],
        colours=np.array(fields["colours"], dtype=np.float64).reshape(-1, 3),
        materials=[material_of(one) for one in fields["materials"]],
    )


def read_here(path: Path, read: Callable[[Path], World]) -> World:
    """Read a world in this process; whatever error a library raises becomes one clear error.

    Raises:
        WorldError: The file cannot be used.
    """
    try:
        return read(path)
    except WorldError as error:
        message = str(error)
        raise WorldError(message if str(path) in message else f"{path}: {message}") from None
    except MemoryError:
        raise WorldError(f"{path}: needs too much memory to read; simplify it") from None
    except Exception as error:
        # The exception depends on the library and on the damage.
        words = " ".join(str(error).split())
        reason = f"{type(error).__name__}: {words}"[:120] if words else type(error).__name__
        raise WorldError(f"{path}: damaged, or not a {path.suffix[1:]} file ({reason})") from None


def _seconds(path: Path) -> float:
    """Limit of the processor time for a file [s]."""
    return SECONDS + SECONDS_A_MEGABYTE * path.stat().st_size / 1e6


def _too_long(path: Path, seconds: float) -> str:
    return f"{path}: takes more than {seconds:.0f} s to read; simplify it, or cut it down"


def _limit(memory: int, seconds: int) -> None:
    """Limit the memory and the processor time of this process, if the system supports it."""
    try:
        import resource
    except ImportError:
        return
    limits = {
        resource.RLIMIT_DATA: memory,
        resource.RLIMIT_CPU: seconds,
        resource.RLIMIT_CORE: 0,
    }
    for limit, most in limits.items():
        try:
            # The hard limit of the time is a second longer, so that SIGXCPU comes before SIGKILL.
            resource.setrlimit(limit, (most, most + (limit == resource.RLIMIT_CPU)))
        except (ValueError, OSError):
            continue


def _main(module: str, function: str, path: Path) -> NoReturn:
    """Read a file by a function of a module; write the world, or the error, to standard output."""
    _limit(MEMORY + MEMORY_A_BYTE * path.stat().st_size, math.ceil(_seconds(path)))
    # The output of libraries must not mix with the data.
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        world = read_here(path, getattr(import_module(module), function))
    except WorldError as error:
        out.write(json.dumps({"error": str(error)}).encode() + b"\n")
    else:
        colours = [
            [float(part) if np.isfinite(part) else None for part in row] for row in world.colours
        ]
        header = {
            "name": world.name,
            "object_names": world.object_names,
            "colours": colours,
            "materials": [one and material_value(one) for one in world.materials],
        }
        walls = np.empty(len(world.segments), dtype=WALLS)
        walls["segment"], walls["object"] = world.segments, world.objects
        walls["height"] = world.heights
        out.write(json.dumps(header).encode() + b"\n")
        out.write(walls.tobytes())
    out.flush()
    os._exit(0)


if __name__ == "__main__":
    _main(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
