"""What benchmarks measured, handed to the pictures."""

from pathlib import Path

from lrf3d.laser import LaserRangeFinder
from lrf3d.render.benchmark_figures import TimeAndError, draw_time_and_error
from lrf3d.study.bench.contest import BATCH
from lrf3d.study.bench.scan import ScanBenchmark


def draw_scan_benchmark(result: ScanBenchmark, path: Path) -> None:
    """Draw the time of a scan against its largest error, and the rates of batches.

    Raises:
        OutputError: The picture cannot be written.
    """
    lrf = LaserRangeFinder()
    rays = BATCH * lrf.beams
    points = [
        TimeAndError(
            entry.rival.key,
            entry.rival.title,
            entry.walls,
            entry.single.median,
            entry.scans.largest,
            entry.corners.largest,
            None if entry.batch is None else rays / entry.batch.median,
            None if entry.alone is None else rays / entry.alone.median,
        )
        for entry in result.entries
    ]
    titles = (
        "Scans: run time against error",
        f"{lrf.beams} beams, range_max {lrf.range_max:g} m, in cities of one density  ·  a point"
        f" for each caster and world  ·  batches of {BATCH:,} scans",
    )
    draw_time_and_error(points, path, titles=titles)
