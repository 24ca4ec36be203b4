"""The report of ``bench`` as a page: one file of HTML with its plots inside."""

import base64
from collections.abc import Callable
from functools import partial
from html import escape
from pathlib import Path

from lrf3d.output import scratch_folder
from lrf3d.render.trade_off_figure import Panel, draw_trade_offs
from lrf3d.render.trade_off_figure import Way as Drawn
from lrf3d.study.bench.comparison import Comparison
from lrf3d.study.bench.part import Part, Way
from lrf3d.study.bench.report_style import STYLE
from lrf3d.study.bench.text import duration, left_out_lines, times_words
from lrf3d.study.bench.whole import Report
from lrf3d.study.bench.whole_text import change_row, error_words, verdict

PANELS = 2
"""Panels that fill the width of the page."""

LEAST_WAYS = 3
"""Ways to do a thing from which on a plot tells more than a table."""


def page_text(report: Report, comparison: Comparison | None = None) -> str:
    """The page as HTML."""
    body = [
        '<main>\n<p class="place">lrf3d bench</p>\n<h1>Run time against error</h1>',
        '<p class="lead">Whatever lrf3d does is timed, and held against what is exact. A ring, and'
        " a row in bold, is what it does by default; below each plot stands what is saved by"
        " work that it skips.</p>",
        _machine(report),
        *([] if comparison is None else [_comparison(comparison)]),
        _glance(report),
        *map(_section, report.parts),
        *(_left_out(key, why) for key, why in report.left_out.items()),
        f"<footer>Made {escape(report.made)} in {report.took:.0f} s. Times are medians of calls"
        " that rivals make in turn, so that what slows the machine slows all alike; bars are"
        " quartiles. All figures stand in <code>report.json</code>; <code>lrf3d bench"
        " --compare report.json</code> tells what has changed since.</footer>\n</main>",
    ]
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>lrf3d bench</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(body)
        + "\n</body>\n</html>\n"
    )


def _machine(report: Report) -> str:
    machine = report.machine
    load = machine["load"]
    busy = "" if load is None else f" · {load:.1f} processes of others at the start"
    return (
        f'<p class="machine">{escape(str(machine["processor"]))} · {machine["cores"]} cores ·'
        f" {escape(str(machine['system']))} · Python {machine['python']}, NumPy"
        f" {machine['numpy']}{busy}</p>"
    )


def _glance(report: Report) -> str:
    rows = [
        [
            f'<a href="#{part.key}">{escape(part.title)}</a>',
            escape(way.thing),
            escape(way.title),
            duration(way.timing.median),
            f"{error_words(way.error)}",
            escape(part.error),
        ]
        for part in report.parts
        for way in part.ways
        if way.chosen and way.thing in _plotted(part)
    ]
    head = ("part", "what is done", "default", "time", "error", "of what")
    return f"<section><h2>What lrf3d does by default</h2>{_table(head, rows, words=3)}</section>"


def _section(part: Part) -> str:
    plotted = _plotted(part)
    pieces = [f'<section id="{part.key}"><h2>{escape(part.title)}</h2>']
    pieces.append(f'<p class="question">{escape(part.question)}</p>')
    if plotted:
        wide = min(1.0, len(plotted) / PANELS)
        draw = partial(_draw_ways, part, plotted)
        pieces.append(_figure(draw, part.title, width=f"{100.0 * wide:g}%"))
    if part.savings:
        pieces.append(_savings(part))
    if part.draw is not None:
        pieces.append(_figure(part.draw, f"{part.title}, in detail"))
    pieces.append(_ways(part))
    if part.skipped:
        lines = "".join(f"<li>{escape(line)}</li>" for line in left_out_lines(part.skipped))
        pieces.append(f'<p class="small">Left out:</p><ul class="small">{lines}</ul>')
    return "\n".join([*pieces, f'<p class="small">Took {part.took:.0f} s.</p></section>'])


def _plotted(part: Part) -> list[str]:
    """The things that there are enough ways to do for a plot."""
    return [
        thing
        for thing in dict.fromkeys(way.thing for way in part.ways)
        if sum(way.thing == thing for way in part.ways) >= LEAST_WAYS
    ]


def _draw_ways(part: Part, things: list[str], path: Path) -> None:
    panels = [
        Panel(
            thing,
            part.time,
            part.error,
            tuple(_drawn(way) for way in part.ways if way.thing == thing),
        )
        for thing in things
    ]
    draw_trade_offs(panels, path, titles=("", ""))


def _drawn(way: Way) -> Drawn:
    timing = way.timing
    times = (timing.low, timing.median, timing.high)
    return Drawn(way.family, way.setting, times, way.error, way.chosen)


def _savings(part: Part) -> str:
    rows = []
    for saving in part.savings:
        ratio = saving.done / saving.skipped
        share = max(0.0, 100.0 * (1.0 - saving.skipped / saving.done))
        rows.append(
            [
                escape(saving.name),
                duration(saving.done),
                duration(saving.skipped),
                times_words(ratio),
                f'<span class="bar"><i style="width:{share:.1f}%"></i></span>',
            ]
        )
    head = ("work that is skipped", "with it", "without", "saves", "part of the time saved")
    return f"<h3>What skipping saves</h3>{_table(head, rows)}"


def _ways(part: Part) -> str:
    rows = []
    for way in part.ways:
        low, high = duration(way.timing.low), duration(way.timing.high)
        cells = [
            escape(way.thing),
            escape(way.title),
            duration(way.timing.median),
            f"{low} – {high}" if way.timing.calls > 1 else "once",
            error_words(way.error),
        ]
        rows.append([f"<b>{cell}</b>" for cell in cells] if way.chosen else cells)
    head = ("what is done", "how", part.time, "quartiles", part.error)
    return f"<details><summary>All figures</summary>{_table(head, rows, words=2)}</details>"


def _comparison(comparison: Comparison) -> str:
    rows = []
    for change in comparison.changes:
        cells = list(map(escape, change_row(change)))
        kind = "bad" if change.worse else "good"
        rows.append([f'<span class="{kind}">{cells[0]}</span>', *cells[1:5], cells[5]])
    lines = [f"The machines differ: {line}." for line in comparison.machines]
    lines += [f"Not compared: {line}" for line in comparison.missing]
    head = ("change", "by", "noise up to", "then", "now", "what")
    notes = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return (
        f"<section><h2>What has changed</h2><p>{escape(verdict(comparison))}</p>"
        + (_table(head, rows, last_word=True) if rows else "")
        + (f'<ul class="small">{notes}</ul>' if notes else "")
        + "</section>"
    )


def _left_out(key: str, why: str) -> str:
    return (
        f'<section id="{key}"><h2>{escape(key.capitalize())}</h2>'
        f'<p class="question">Left out: {escape(why)}</p></section>'
    )


def _figure(draw: Callable[[Path], object], words: str, *, width: str = "100%") -> str:
    with scratch_folder() as folder:
        path = folder / "figure.svg"
        draw(path)
        data = base64.b64encode(path.read_bytes()).decode("ascii")
    source = f"data:image/svg+xml;base64,{data}"
    words = escape(f"{words}: time against error")
    return f'<figure><img style="width: {width}" src="{source}" alt="{words}"></figure>'


def _table(
    head: tuple[str, ...], rows: list[list[str]], *, words: int = 1, last_word: bool = False
) -> str:
    """A table whose first columns hold words, and the others numbers."""
    last = len(head) - 1

    def kind(column: int) -> str:
        return ' class="word"' if column < words or (last_word and column == last) else ""

    titles = "".join(f"<th{kind(k)}>{escape(word)}</th>" for k, word in enumerate(head))
    body = "\n".join(
        "<tr>" + "".join(f"<td{kind(k)}>{cell}</td>" for k, cell in enumerate(row)) + "</tr>"
        for row in rows
    )
    return (
        f'<div class="scroll"><table><thead><tr>{titles}</tr></thead>\n'
        f"<tbody>{body}</tbody></table></div>"
    )
