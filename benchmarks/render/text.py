"""The tables of ``bench render``, as text."""

from lrf3d.study.bench.render_result import PICTURE, RenderBenchmark
from lrf3d.study.bench.text import duration, ratio_table, saving_table, table


def render_text(result: RenderBenchmark) -> str:
    """The benchmark of drawing, as tables with what each column means."""
    head = ("drawn by", "world", "buildings", "samples", "frame", "quartiles", "error")
    rows = [
        (
            entry.title,
            entry.world,
            f"{entry.buildings:,}",
            f"{entry.samples}",
            duration(entry.timing.median),
            f"{1e3 * entry.timing.low:.1f}–{1e3 * entry.timing.high:.1f}",
            "" if entry.error is None else f"{entry.error:.2f}",
        )
        for entry in result.entries
    ]
    parts = [
        table(head, rows),
        f"{PICTURE[0]}x{PICTURE[1]} from the chase camera, full look, one process; frame: the"
        " median, quartiles in ms.\nerror: root mean square of a picture's differences, of 255,"
        " from the same way to draw at 16 times\nthe pixels, words left out.",
        table(
            ("layer of the city", "time"),
            [(layer, f"{1e3 * took:.2f} ms") for layer, took in result.layers.items()],
        ),
    ]
    if result.ratios:
        parts.append(ratio_table(result.ratios))
    if result.savings:
        parts.append(saving_table(result.savings))
    return "\n\n".join([*parts, f"took {result.took:.0f} s"])
