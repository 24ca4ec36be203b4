"""The report of ``scripts/bench`` as a page."""

from collections.abc import Sequence
from html import escape

from benchmarks.page import Html, embed_figure, note, page, picture, section, table
from benchmarks.panels import TradeOff, draw_panels
from benchmarks.parts import Part
from benchmarks.results import Saving
from benchmarks.text import duration, error_words, left_out_lines, quartiles, times_words
from benchmarks.whole import Report

PANELS = 2
"""Panels that fill the width of the page."""

LEAST_METHODS = 3
"""Methods to do a thing from which on a plot shows more than a table."""


def page_text(report: Report) -> str:
    """The report as a page."""
    machine = report.machine
    load = machine["load"]
    busy = "" if load is None else f" · {load:.1f} processes of others at the start"
    return page(
        "Run time against error",
        "scripts/bench",
        "Whatever lrf3d does is timed, and compared with what is exact. A ring, and a row in bold,"
        " is what it does by default; below each plot stands what is saved by work that it skips.",
        [
            note(
                f"{machine['processor']} · {machine['cores']} cores · {machine['system']} · Python"
                f" {machine['python']}, NumPy {machine['numpy']}{busy}"
            ),
            _overview(report),
            *map(_section, report.parts),
            *(
                section(key, key.capitalize(), note(f"Left out: {why}"))
                for key, why in report.left_out.items()
            ),
        ],
        Html(
            f"Made {report.made} in {report.took:.0f} s. Times are medians of calls"
            " that the methods make in turn, so that what slows the machine slows all alike; bars"
            " are quartiles. All figures stand in <code>report.json</code>;"
            " <code>scripts/bench --compare report.json</code> prints what has changed since."
        ),
    )


def _overview(report: Report) -> str:
    rows = [
        [
            Html(f'<a href="#{part.key}">{part.title}</a>'),
            method.thing,
            method.title,
            duration(method.time.median),
            error_words(method.error),
            part.error,
        ]
        for part in report.parts
        for method in part.methods
        if method.default and method.thing in _plotted(part)
    ]
    head = ("part", "what is done", "default", "time", "error", "of what")
    return section("defaults", "What lrf3d does by default", table(head, rows, words=3))


def _section(part: Part) -> str:
    pieces: list[str] = [Html(f'<p class="lead">{part.question}</p>')]
    plotted = _plotted(part)
    rows = [plotted[k : k + PANELS] for k in range(0, len(plotted), PANELS)]
    if rows:
        figure = draw_panels(
            [
                [
                    TradeOff(thing, part.time, part.error,
                             [method for method in part.methods if method.thing == thing])
                    for thing in row
                ]
                for row in rows
            ]
        )  # fmt: skip
        words = f"{part.title}: time against error"
        pieces.append(picture(embed_figure(figure), words, shown=False))
    if part.savings:
        pieces += [Html("<h3>What skipping saves</h3>"), _savings(part.savings)]
    if part.result is not None:
        panels, titles = part.result.panels()
        figure = draw_panels(panels, titles=titles)
        pieces.append(picture(embed_figure(figure), f"{part.title}, in detail", shown=False))
    pieces.append(_all_methods(part))
    if part.skipped:
        pieces += [note(f"Left out: {line}") for line in left_out_lines(part.skipped)]
    return section(part.key, part.title, *pieces, note(f"Took {part.took:.0f} s."))


def _plotted(part: Part) -> list[str]:
    """The things that there are enough methods to do for a plot."""
    things = [method.thing for method in part.methods]
    return [thing for thing in dict.fromkeys(things) if things.count(thing) >= LEAST_METHODS]


def _savings(savings: Sequence[Saving]) -> str:
    rows = []
    for saving in savings:
        share = max(0.0, 100.0 * (1.0 - saving.skipped / saving.done))
        rows.append([
            saving.name,
            duration(saving.done),
            duration(saving.skipped),
            times_words(saving.done / saving.skipped),
            Html(f'<span class="bar"><i style="width:{share:.1f}%"></i></span>'),
        ])  # fmt: skip
    head = ("work that is skipped", "with it", "without", "saves", "part of the time saved")
    return table(head, rows)


def _all_methods(part: Part) -> str:
    rows = []
    for method in part.methods:
        time = method.time
        cells = [
            method.thing,
            method.title,
            duration(time.median),
            quartiles(time.low, time.high) if time.calls > 1 else "once",
            error_words(method.error),
        ]
        rows.append([Html(f"<b>{escape(cell)}</b>") for cell in cells] if method.default else cells)
    head = ("what is done", "how", part.time, "quartiles", part.error)
    return Html(f"<details><summary>All figures</summary>{table(head, rows, words=2)}</details>")
