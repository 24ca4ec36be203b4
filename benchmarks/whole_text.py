"""The report of ``bench`` as text: what lrf3d chooses in each part, and what has changed."""

from lrf3d.study.bench.comparison import Change, Comparison
from lrf3d.study.bench.text import duration, left_out_lines, saving_table, table
from lrf3d.study.bench.whole import Report


def whole_text(report: Report, comparison: Comparison | None = None) -> str:
    """The ways that lrf3d chooses by default, what is skipped, and what has changed."""
    parts = [_chosen(report)]
    savings = [saving for part in report.parts for saving in part.savings]
    if savings:
        parts.append(saving_table(savings))
    left_out = [f"left out: {key}: {why}" for key, why in report.left_out.items()]
    left_out += [
        f"left out: {part.key}: {line}"
        for part in report.parts
        for line in left_out_lines(part.skipped)
    ]
    if left_out:
        parts.append("\n".join(left_out))
    if comparison is not None:
        parts.append(comparison_text(comparison))
    return "\n\n".join([*parts, f"took {report.took:.0f} s"])


def _chosen(report: Report) -> str:
    head = ("part", "default", "time", "quartiles", "error", "unit of the error")
    rows = []
    for part in report.parts:
        for way in part.ways:
            if way.chosen:
                low, high = duration(way.timing.low), duration(way.timing.high)
                rows.append(
                    (
                        f"{part.key}: {way.thing}",
                        way.title,
                        duration(way.timing.median),
                        f"{low}–{high}",
                        error_words(way.error),
                        part.error,
                    )
                )
    return table(head, rows)


def error_words(error: float) -> str:
    """An error with three digits, or that there is none."""
    return "none" if error == 0.0 else f"{error:.3g}"


def comparison_text(comparison: Comparison) -> str:
    """What became slower or less exact, and what the noise hides."""
    lines = [verdict(comparison)]
    if comparison.changes:
        head = ("change", "by", "noise up to", "then", "now", "what")
        lines.append(table(head, [change_row(change) for change in comparison.changes]))
    lines += [f"The machines differ: {line}." for line in comparison.machines]
    lines += [
        f"In {key} the machine itself took {ratio:.2f} times as long for the same work."
        for key, ratio in comparison.speeds.items()
        if max(ratio, 1.0 / ratio) > 1.1
    ]
    lines += [f"not compared: {line}" for line in comparison.missing]
    return "\n".join(lines)


def verdict(comparison: Comparison) -> str:
    """In a sentence, how two reports compare."""
    worse = [change for change in comparison.changes if change.worse]
    slower = sum(change.what == "time" for change in worse)
    less = len(worse) - slower
    better = len(comparison.changes) - len(worse)
    return (
        f"Against {comparison.against} of {comparison.made}: of {comparison.compared} figures"
        f" {slower} slower, {less} less exact, {better} faster or more exact; the others differ by"
        " no more than the noise of both."
    )


def change_row(change: Change) -> tuple[str, ...]:
    """A change as the cells of a table."""
    by = "from none" if change.ratio is None else f"{change.ratio:.3g} ×"
    tell = duration if change.what == "time" else error_words
    return (
        change.words,
        by,
        f"{change.noise:.2f} ×",
        tell(change.old),
        tell(change.new),
        f"{change.part}: {change.thing}, {change.way}",
    )
