"""``scripts/soak``: whether memory, descriptors, threads or temporary files grow over time.

A long run, sweeps one after the other, and a page that is opened again and again run side by side.
The processes of each are measured from the outside; the second quarter of the time, when all that
is loaded once is loaded, is compared with the last.
"""

import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import typer

from lrf3d.cli import main, options

app = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False, add_completion=False)

INTERVAL = 2.0
"""Time between two measurements [s]."""

MEMORY_NOISE = 24.0
"""Growth of memory [MB] that is no leak: the allocator keeps some pages more or less."""

COUNT_NOISE = 2
"""Growth of the numbers of descriptors, threads and files that is no leak: some come and go."""

END = 120.0
"""Time in which a program that is stopped has to end [s]; one that is killed after it leaves files
behind. A sweep stops its workers first, which takes long on a busy machine."""

SWEEPS = """
import shutil, sys
from pathlib import Path
from lrf3d import sweep
folder = Path(sys.argv[1])
axes = {"noise.sigma": (0.0, 0.1), "laser.beams": (31,)}
if __name__ == "__main__":
    while True:
        sweep("paper_room", axes=axes, seeds=2, folder=folder, workers=1)
        shutil.rmtree(folder)
        print("sweep", flush=True)
"""
"""A program that makes one sweep after the other."""


@dataclass(slots=True)
class Part:
    """A program that runs during the soak, and what was measured of it.

    Args:
        process: Its process.
        address: The address of its page; empty if it has none.
        samples: By what was measured, the values over time.
        ended: What it printed last, if it ended by itself.
    """

    process: "subprocess.Popen[bytes]"
    address: str = ""
    samples: dict[str, list[float]] = field(default_factory=dict)
    ended: str | None = None


@app.command(epilog="Example: scripts/soak --minutes 60")
def soak(
    minutes: Annotated[float, typer.Option(min=0.1, help="How long it takes.")] = 10.0,
    json: options.Json = False,
) -> None:
    """Run a long drive, sweeps and the browser's page side by side, and see what grows.

    Ends with the status 1 if memory, descriptors, threads or temporary files of one grow, if one
    ends by itself, or if one leaves temporary files behind.
    """
    from lrf3d.cli.console import print_json, print_table, progress_bar

    with tempfile.TemporaryDirectory(prefix="soak-") as name:
        folder = Path(name)
        (folder / "tmp").mkdir()
        with started(folder) as parts, progress_bar("soak") as progress:
            begin = time.monotonic()
            while (passed := time.monotonic() - begin) < 60.0 * minutes:
                progress(int(passed), int(60.0 * minutes))
                time.sleep(INTERVAL)
                measure(parts, folder / "tmp")
        left = sorted(path.name for path in (folder / "tmp").rglob("*"))
    report, faults = growth(parts)
    faults += [f"left behind: {each}" for each in left]
    if json:
        print_json({"minutes": minutes, "parts": report, "faults": faults})
    else:
        rows = [
            (f"{part} {what}", f"{before:,.0f} -> {after:,.0f}")
            for part, values in report.items()
            for what, (before, after) in values.items()
        ]
        print_table(rows, max(len(row[0]) for row in rows))
        print("\n".join(faults) or "nothing grew")
    raise typer.Exit(bool(faults))


@contextmanager
def started(folder: Path) -> Iterator[dict[str, Part]]:
    """The programs, each in a folder of its own; they are stopped as by Ctrl-C afterwards."""
    from lrf3d.view.server import free_port

    # Where the soak itself runs in the background, Ctrl-C is ignored, and programs inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    port = free_port("127.0.0.1", None)
    lrf3d = [sys.executable, "-m", "lrf3d"]
    drive = ["run", "paper_room", "--scans", "10000000", "--no-video", "--out", folder / "run"]
    view = ["view", "paper_room", "--no-browser", "--port", str(port)]
    (folder / "sweeps.py").write_text(SWEEPS)
    commands = {
        "run": [*lrf3d, *map(str, drive), "--set", "laser.beams=7"],
        "sweeps": [sys.executable, str(folder / "sweeps.py"), str(folder / "sweep")],
        "page": [*lrf3d, *view],
    }
    environment = {**os.environ, "TMPDIR": str(folder / "tmp"), "OMP_NUM_THREADS": "1"}
    parts: dict[str, Part] = {}
    try:
        for name, command in commands.items():
            with (folder / f"{name}.log").open("wb") as log:
                process = subprocess.Popen(
                    command, env=environment, stdout=log, stderr=log, start_new_session=True
                )
            parts[name] = Part(process, f"http://127.0.0.1:{port}" if name == "page" else "")
        yield parts
        for name, part in parts.items():
            if part.process.poll() is not None:
                said = (folder / f"{name}.log").read_text(errors="replace").splitlines()
                part.ended = said[-1] if said else ""
    finally:
        for part in parts.values():
            stop(part.process)


def stop(process: "subprocess.Popen[bytes]") -> None:
    """Stop a program as Ctrl-C does, or at last by force."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(END)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def measure(parts: Mapping[str, Part], temporary: Path) -> None:
    """Measure all programs once, and open the pages."""
    for part in parts.values():
        for path in ("/", "/lrf3d/scene.glb") if part.address else ():
            try:
                with urllib.request.urlopen(part.address + path, timeout=10.0) as page:
                    page.read()
            except (urllib.error.URLError, TimeoutError, ConnectionError):
                # The page is not there yet, or the machine is busy.
                break
        for what, value in measured(part.process.pid).items():
            part.samples.setdefault(what, []).append(value)
        part.samples.setdefault("temporary files", []).append(len(list(temporary.rglob("*"))))


def measured(process: int) -> dict[str, float]:
    """Memory [MB], descriptors and threads of a process; nothing if it has ended."""
    folder = Path("/proc", str(process))
    try:
        status = dict(
            line.split(":", 1)
            for line in (folder / "status").read_text().splitlines()
            if ":" in line
        )
        return {
            "memory [MB]": int(status["VmRSS"].split()[0]) / 1024.0,
            "descriptors": len(os.listdir(folder / "fd")),
            "threads": int(status["Threads"]),
        }
    except (OSError, KeyError):
        return {}


def growth(
    parts: Mapping[str, Part],
) -> tuple[dict[str, dict[str, tuple[float, float]]], list[str]]:
    """What the second and the last quarter held, and what has grown.

    Of memory it is the median. Of descriptors, threads and files it is the least: a sweep under way
    holds more of them, for a time that depends on what else the machine does, and between two
    sweeps only what leaks is left.
    """
    report: dict[str, dict[str, tuple[float, float]]] = {}
    faults = []
    for name, part in parts.items():
        report[name] = {}
        if part.ended is not None:
            faults.append(f"{name}: ended by itself: {part.ended}")
        for what, values in part.samples.items():
            quarter = max(1, len(values) // 4)
            held = statistics.median if "memory" in what else min
            before, after = held(values[quarter : 2 * quarter] or values), held(values[-quarter:])
            report[name][what] = (before, after)
            if after - before > (MEMORY_NOISE if "memory" in what else COUNT_NOISE):
                faults.append(f"{name}: {what} grew from {before:,.0f} to {after:,.0f}")
    return report, faults


if __name__ == "__main__":
    main(app, "scripts/soak")
