"""What only a fresh process shows: the first call of a caster, and the memory of a batch.

``python -m benchmarks.scan.processes WHAT CASTER WALLS`` measures itself and prints JSON.
"""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

BATCH = 20_000
"""Scans of the batch whose memory is measured: its output is 29 MB, well above the noise."""

PROBE_SECONDS = 60.0
"""How long a probe may take: kernels may have to be compiled in it."""


def probe(what: str, caster: str, walls: int) -> dict[str, Any]:
    """Run a probe in a fresh process: ``first_call`` or ``memory``."""
    done = subprocess.run(
        [sys.executable, "-m", __name__, what, caster, str(walls)],
        capture_output=True,
        text=True,
        check=True,
        timeout=PROBE_SECONDS,
        cwd=Path(__file__).parents[2],
    )
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def first_call(caster: str, walls: int) -> dict[str, float]:
    """Seconds to import, to build and to cast the first scan, and the scan after it."""
    start = time.perf_counter()
    import lrf3d

    made = lrf3d.PlanarCaster if caster == "planar" else lrf3d.EmbreeCaster
    lrf = lrf3d.LaserRangeFinder()
    imported = time.perf_counter()
    # The world is no part of what is measured.
    from lrf3d.world.generators import generate_city

    world = generate_city(walls)
    pose = (10.0, 10.0, 0.0)
    generated = time.perf_counter()
    cast = made(world).cast
    cast(lrf, pose)
    first = time.perf_counter()
    cast(lrf, pose)
    second = time.perf_counter()
    return {
        "import_s": imported - start,
        "first_scan_s": first - generated,
        "second_scan_s": second - first,
        "until_first_scan_s": imported - start + first - generated,
    }


def memory(caster: str, walls: int) -> dict[str, int]:
    """Bytes of a batch's output, and how much the memory rose above what stood before it."""
    import numpy as np

    import lrf3d
    from lrf3d.world.generators import city_crossings, generate_city

    lrf = lrf3d.LaserRangeFinder()
    world, poses = generate_city(walls), city_crossings(walls, BATCH)
    made = lrf3d.PlanarCaster(world) if caster == "planar" else lrf3d.EmbreeCaster(world)
    made.cast_batch(lrf, poses[:500])
    before = resident_bytes("VmRSS")
    # Writing 5 here starts the peak anew.
    Path("/proc/self/clear_refs").write_text("5")
    ranges = made.cast_batch(lrf, poses)
    return {
        "output_bytes": int(np.asarray(ranges).nbytes),
        "peak_bytes": resident_bytes("VmHWM") - before,
    }


def resident_bytes(line: str = "VmRSS") -> int:
    """Memory that this process holds, or held at most (VmHWM), from Linux's own account."""
    status = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(row.split()[1]) for row in status if row.startswith(line))


if __name__ == "__main__":
    _measure = {"first_call": first_call, "memory": memory}[sys.argv[1]]
    print(json.dumps(_measure(sys.argv[2], int(sys.argv[3]))))
