"""What ``bench drive`` measured, handed to the pictures."""

from pathlib import Path

from lrf3d.render.trade_off_figure import Panel, Way, draw_trade_offs
from lrf3d.study.bench.drive_bench import DriveBenchmark


def draw_drive_benchmark(result: DriveBenchmark, path: Path) -> None:
    """Draw the time of a drive against how far off its end is, for each kind of inputs.

    Raises:
        OutputError: The picture cannot be written.
    """
    panels = []
    for inputs in dict.fromkeys(entry.inputs for entry in result.entries):
        ways = tuple(
            Way(
                entry.integrator.family,
                entry.integrator.setting,
                (entry.timing.low, entry.timing.median, entry.timing.high),
                entry.position,
                entry.integrator.chosen,
            )
            for entry in result.entries
            if entry.inputs == inputs
        )
        panels.append(Panel(inputs, "time of the whole drive", "end off by [m]", ways))
    titles = (
        "Driving: run time against error",
        f"the place after {result.driven:,.0f} s of driving, against the true one  ·  beside the"
        " points: the step, or the tolerance of RK45",
    )
    draw_trade_offs(panels, path, titles=titles)
