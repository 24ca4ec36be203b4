"""What ``bench render`` measured, handed to the pictures."""

from pathlib import Path

from lrf3d.render.render_benchmark_figure import DrawnPoint, draw_render_benchmark_figure
from lrf3d.study.bench.render_result import PICTURE, RenderBenchmark


def draw_render_benchmark(result: RenderBenchmark, path: Path) -> None:
    """Draw time against error, time by buildings, and what the layers cost.

    Raises:
        OutputError: The picture cannot be written.
    """
    points = [
        DrawnPoint(
            entry.title,
            entry.samples,
            entry.world == "city",
            entry.buildings,
            entry.timing.median,
            entry.error,
        )
        for entry in result.entries
    ]
    titles = (
        "Pictures: time against error",
        f"{PICTURE[0]} × {PICTURE[1]} from the chase camera, software OpenGL, one process  ·"
        "  error against 16 times the pixels",
    )
    draw_render_benchmark_figure(points, result.layers, path, titles=titles)
