"""What ``bench map`` measured, handed to the pictures."""

from pathlib import Path

from lrf3d.render.map_benchmark_figure import draw_map_benchmark_figure
from lrf3d.render.map_benchmark_panels import PairPoint, SettingPoint, SizePoint, StorePoint
from lrf3d.scenario import SIGMA
from lrf3d.study.bench.map_accuracy import USUAL_BEAMS
from lrf3d.study.bench.map_bench import MapBenchmark


def draw_map_benchmark(result: MapBenchmark, path: Path) -> None:
    """Draw error and time over all settings, updates by size, numbers to store, and line pairs.

    Raises:
        OutputError: The picture cannot be written.
    """
    points = [
        SettingPoint(
            entry.setting.mode,
            entry.setting.varied,
            entry.setting.value,
            entry.score("segment_f1"),
            entry.score("length_f1"),
            entry.update.median,
        )
        for entry in result.entries
    ]
    sizes = [SizePoint(entry.mode, entry.walls, entry.update.median) for entry in result.sizes]
    stores = [
        StorePoint(
            entry.mode,
            entry.count.union_numbers,
            entry.count.polyline_numbers,
            entry.count.grid_cells,
        )
        for entry in result.memory
    ]
    pairs = [
        PairPoint(entry.strategy, entry.known, entry.comparisons, entry.pairing.median)
        for entry in result.pairs
    ]
    titles = (
        "Maps: error against run time",
        f"{result.scans} scans along the drive through the city  ·  {USUAL_BEAMS} beams and"
        f" σ = {SIGMA:g} m where nothing else is said",
    )
    draw_map_benchmark_figure(points, sizes, stores, pairs, path, titles=titles)
