"""Compile kernels before they are needed, by processes side by side.

A small drive in plain Python finds which kernels are called, and with which types. Their machine
code is put on disk, where the program that waits for it, and all later ones, find it.
"""

import gc
import os
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from time import sleep
from typing import Any

from lrf3d.base.cores import core_count, process_pool
from lrf3d.base.interrupts import MOMENT, Progress, check

# The file of the kernel that takes longest: where there is one, kernels have been compiled.
FILES = "lrf3d.mapping.robust.refitting.refit_walls.*.nbc"


def start_compiling(*parts: str) -> "Popen[bytes] | None":
    """Start to compile what each run needs, if nothing has been compiled for this installation.

    The parts ``slam`` and ``planar``, a caster, are compiled where they are named.
    """
    package = Path(__file__).parents[2]
    home = Path(os.path.expanduser("~"))
    given = os.environ.get("NUMBA_CACHE_DIR")
    caches = (
        package / "mapping/robust/__pycache__",
        Path(given or home / ".cache/numba"),
    )
    released = package / "compiling/released"
    versions = f"{version('numba')}-{version('numpy').rpartition('.')[0]}"
    own = f"{FILES.removesuffix('.nbc')}py{sys.version_info[0]}{sys.version_info[1]}*"
    reasons_against = (
        "NUMBA_DISABLE_JIT" in os.environ,
        core_count() < 2,
        os.name != "posix",
        any(next(cache.rglob(FILES), None) for cache in caches),
        any((released / versions).glob(own)),
        not any(
            os.access(folder, os.W_OK)
            for folder in ([Path(given).parent] if given else [package, home])
        ),
    )
    if any(reasons_against):
        return None
    environment = {
        **os.environ,
        "NUMBA_DISABLE_JIT": "1",
        # Numba colours the messages of its trials of types, which takes longer than the trials.
        "NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING": "1",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    return Popen(
        [sys.executable, "-m", "lrf3d.apps.cli.kernels", *parts], env=environment,
        stdin=DEVNULL, stdout=PIPE, stderr=DEVNULL, start_new_session=True,
    )  # fmt: skip


def wait_for(process: "Popen[bytes]", progress: Progress) -> None:
    """Wait until kernels are compiled; if that fails they are compiled when they are called."""
    from multiprocessing.connection import wait

    assert process.stdout is not None
    while True:
        check()
        if wait([process.stdout.fileno()], MOMENT):
            if not (printed := os.read(process.stdout.fileno(), 4096)):
                return
            # Each line was written in one piece.
            progress(*map(int, printed.splitlines()[-1].split()))


def main(*parts: str) -> None:
    """Compile all kernels of a small drive, and print how many are done, and of how many."""
    from concurrent.futures import as_completed
    from threading import Thread

    Thread(target=_end_with_parent, args=(os.getppid(),), daemon=True).start()

    calls = sorted(_calls(*parts), key=lambda call: not call[0].startswith("lrf3d.mapping"))
    # This process runs kernels as plain Python; those that it starts compile.
    del os.environ["NUMBA_DISABLE_JIT"]
    with process_pool(core_count()) as pool:
        futures = [pool.submit(_compile, *call) for call in calls]
        for done, future in enumerate(as_completed(futures), start=1):
            future.result()
            os.write(1, f"{done} {len(calls)}\n".encode())


def _end_with_parent(parent: int) -> None:
    """End this process when the program that waits for it has ended, however it did."""
    while os.getppid() == parent:
        sleep(MOMENT)
    os._exit(1)


def _calls(*parts: str) -> list[tuple[str, str, Any]]:
    """The module, the name and the types of the arguments of each kernel that a drive calls."""
    import numba

    import lrf3d.compiling as compiling

    calls: dict[tuple[str, str, Any], None] = {}

    def recorded(kernel: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any) -> Any:
            types = tuple(map(numba.typeof, args))
            known = {**calls, (kernel.__module__, kernel.__qualname__, types): None}
            found = kernel(*args)
            # What a kernel calls becomes part of it.
            calls.clear()
            calls.update(known)
            return found

        return call

    compiling.compiled = recorded  # type: ignore[assignment]
    import lrf3d

    world = lrf3d.World([[3, -1, 3, 1], [3, 1, 4, 1], [-2, -3, 2, -3]])
    lrf = lrf3d.LaserRangeFinder(beams=31)
    drive = [(0.5 * step, 0, 0.5 * step) for step in range(3)]
    lrf3d.simulate(world, drive, lrf, caster="embree", rng=0)
    if "slam" in parts:
        slam = import_module("lrf3d.slam")
        lrf3d.simulate(world, drive, lrf, caster="embree", mapper=slam.SlamMapper(), rng=0)
    if "planar" in parts:
        lrf3d.simulate(world, drive, lrf, caster="planar", rng=0)
    return list(calls)


def _compile(module: str, name: str, types: Any) -> None:
    gc.disable()  # What compiling leaves behind ends with the process.
    getattr(import_module(module), name).compile(types)


if __name__ == "__main__":
    main(*sys.argv[1:])
