"""Tables of benchmarks, as text."""

from collections.abc import Sequence

from lrf3d.laser import LaserRangeFinder
from lrf3d.study.bench.ablation import Saving
from lrf3d.study.bench.contest import BATCH, Entry
from lrf3d.study.bench.ratios import Ratio
from lrf3d.study.bench.scan import ScanBenchmark

EXACT = "exact"
"""What stands for an error of 0."""


def scan_text(result: ScanBenchmark) -> str:
    """The benchmark of scans, as tables with what each column means."""
    parts = [_casters(result.entries), _notes()]
    if result.memory or result.first_calls:
        parts.append(_processes(result))
    if result.ratios:
        parts.append(ratio_table(result.ratios))
    if result.savings:
        parts.append(saving_table(result.savings))
    if result.skipped:
        parts.append("\n".join(f"left out: {line}" for line in result.skipped))
    if result.busy:
        parts.append(
            f"Others used this machine (load {result.load:.1f} before the start): the rates on all"
            " cores are too low."
        )
    return "\n\n".join([*parts, f"took {result.took:.0f} s"])


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Rows under a head; the first column to the left, the others to the right."""
    widths = [max(len(row[k]) for row in [head, *rows]) for k in range(len(head))]
    lines = []
    for row in [head, *rows]:
        cells = [
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def _casters(entries: list[Entry]) -> str:
    head = (
        "caster", "walls", "scan", "largest error", "wrong walls", "over 1 cm", "batch",
        "one core", "index",
    )  # fmt: skip
    rays = BATCH * LaserRangeFinder().beams
    rows = []
    for entry in entries:
        wrong = entry.corners.wrong
        rows.append(
            (
                entry.rival.title,
                f"{entry.walls:,}",
                duration(entry.single.median),
                metres(entry.largest_error),
                "?" if wrong is None else percent(wrong / entry.corners.beams),
                percent(entry.corners.gross / entry.corners.beams),
                "" if entry.batch is None else f"{rays / entry.batch.median / 1e6:.1f} M/s",
                "" if entry.alone is None else f"{rays / entry.alone.median / 1e6:.1f} M/s",
                "" if entry.index is None else f"{entry.index / entry.walls:.0f} B/wall",
            )
        )
    return table(head, rows)


def _notes() -> str:
    lrf = LaserRangeFinder()
    return (
        f"scan: {lrf.beams} beams, range_max {lrf.range_max:g} m, the median. largest error: of"
        " all beams, against\nthe exact ranges, which `lrf3d stress` certifies. wrong walls, over"
        " 1 cm: of beams aimed within\n1e-9 to 1e-5 rad of corners. batch, one core: rays a second"
        f" of {BATCH} scans in one call."
    )


def _processes(result: ScanBenchmark) -> str:
    head = ("fresh process", "import", "first scan", "next scan", "batch output", "batch peak")
    rows = []
    for caster, times in result.first_calls.items():
        memory = result.memory.get(caster)
        rows.append(
            (
                caster,
                duration(times["import_s"]),
                duration(times["first_scan_s"]),
                duration(times["second_scan_s"]),
                "" if memory is None else f"{memory['output_bytes'] / 1e6:.1f} MB",
                "" if memory is None else f"{memory['peak_bytes'] / 1e6:.1f} MB",
            )
        )
    return table(head, rows)


def ratio_table(ratios: Sequence[Ratio]) -> str:
    """What a benchmark promises, as measured."""
    rows = [
        (
            ratio.name,
            f"{ratio.value:.2f}",
            f"{'≥' if ratio.at_least else '≤'} {ratio.bound:g}",
            "" if ratio.kept else "missed",
        )
        for ratio in ratios
    ]
    return table(("ratio", "measured", "meant", ""), rows)


def saving_table(savings: Sequence[Saving]) -> str:
    """What skipping work saves."""
    rows = [
        (
            saving.name,
            duration(saving.skipped),
            duration(saving.done),
            times_words(saving.done / saving.skipped),
        )
        for saving in savings
    ]
    return table(("work that is skipped", "skipped", "done", "saves"), rows)


def times_words(ratio: float) -> str:
    """How many times as much, with three digits."""
    return f"{ratio:,.0f} ×" if ratio >= 100.0 else f"{ratio:.3g} ×"


def left_out_lines(lines: Sequence[str]) -> list[str]:
    """What was left out, as ``WHAT: WHY``, with all that one reason holds for in one line."""
    whys: dict[str, list[str]] = {}
    for line in lines:
        what, _, why = line.rpartition(": ")
        whys.setdefault(why, []).append(what)
    return [f"{', '.join(dict.fromkeys(whats))}: {why}" for why, whats in whys.items()]


def duration(seconds: float) -> str:
    """A time with three digits, in the unit that suits it."""
    for unit, name in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds * 1e9:.3g} ns"


def metres(length: float) -> str:
    """An error with two digits."""
    return EXACT if length == 0.0 else f"{length:.1e} m"


def percent(share: float) -> str:
    """A share in percent; none is a plain 0."""
    return "0" if share == 0.0 else f"{100.0 * share:.2g} %"
