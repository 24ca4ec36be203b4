"""A process that draws and encodes one part of a film: how it is started, and what ended it."""

import os
import pickle
import subprocess
import sys
from pathlib import Path


def start_drawer(
    job_file: Path, first: int, last: int, part: Path, *, threads: int
) -> "subprocess.Popen[bytes]":
    """Start a process that draws the frames from first to before last into a part.

    Its standard output gives a byte for each frame that is done: :mod:`lrf3d.render.worker`.
    """
    environment = {
        **os.environ,
        # Read by Mesa's software OpenGL: more threads than cores only wait for each other.
        "LP_NUM_THREADS": str(threads),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
    }
    command = [sys.executable, "-m", "lrf3d.render.worker"]
    with part.with_suffix(".log").open("wb") as log:
        return subprocess.Popen(
            [*command, str(job_file), str(first), str(last), str(part)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=log,
            env=environment,
            # An interrupt is for the caller, who then ends these.
            start_new_session=True,
        )


def end_drawer(process: "subprocess.Popen[bytes]") -> None:
    """End a drawer, whatever it is doing, and wait until it is gone."""
    process.kill()
    process.wait()
    assert process.stdout is not None
    process.stdout.close()


def failure_of(status: int, part: Path) -> Exception:
    """What ended a drawer: the error that it left, or the end of what it printed."""
    left = part.with_suffix(".error")
    if left.exists():
        error = pickle.loads(left.read_bytes())
        assert isinstance(error, Exception)
        return error
    log = part.with_suffix(".log").read_text(errors="replace").strip()
    return RuntimeError(f"drawing a part of the film failed with status {status}:\n{log[-3000:]}")
