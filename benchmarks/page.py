"""The page of a report: one file of HTML with its style and its pictures inside."""

import base64
from collections.abc import Iterable, Sequence
from html import escape
from io import BytesIO

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks.result import RATIOS, SAVINGS, Result, Row, Table, left_out_lines

QUALITY = 90
"""Quality of JPEG pictures: no blocks are seen in skies at it."""

DOTS_PER_INCH = 130
"""Of figures that are made of dots: two a pixel of the usual screen at the width of a page."""

STYLE = """
:root { --ink: #20262e; --faint: #68727f; --line: #e1e5ea; }
* { box-sizing: border-box; }
body { margin: 0; background: #fbfaf8; color: var(--ink); font: 17px/1.6 Charter, Georgia, serif; }
main { max-width: 1160px; margin: 0 auto; padding: 64px 32px 96px; }
h1 { font-size: 42px; line-height: 1.15; margin: 0 0 12px; }
h2 { font-size: 27px; line-height: 1.25; margin: 0; }
.lead { color: var(--faint); font-size: 19px; max-width: 46em; margin: 0 0 24px; }
.note { color: var(--faint); font-size: 13px; margin: 6px 0 16px; }
.place, .note, .verdict, th, td, figcaption, dt, footer, summary {
  font-family: "Inter", "Helvetica Neue", "Segoe UI", "DejaVu Sans", Arial, sans-serif; }
.place, footer { color: var(--faint); font-size: 13px; margin: 0 0 6px; }
section { background: #fff; border: 1px solid var(--line); border-radius: 10px;
  padding: 36px 40px 28px; margin: 36px 0; }
.head { display: flex; justify-content: space-between; gap: 24px; align-items: flex-start; }
.verdict { flex: none; font-size: 13px; font-weight: 600; padding: 3px 12px; border-radius: 99px;
  border: 1px solid currentColor; white-space: nowrap; }
.good { color: #1d7a55; } .fair { color: #9a6a00; } .bad { color: #b3261e; }
.none { color: var(--faint); }
dl { display: grid; grid-template-columns: 1fr 1fr; gap: 8px 40px; margin: 22px 0 18px; }
dt { font-size: 12px; font-weight: 600; text-transform: uppercase; color: var(--faint); }
dd { margin: 0; }
figure { margin: 24px 0 8px; }
figure img { display: block; width: 100%; height: auto; }
figcaption { font-size: 13.5px; color: var(--faint); margin-top: 8px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 14px; margin: 18px 0 6px;
  font-variant-numeric: tabular-nums; }
th { font-weight: 600; color: var(--faint); font-size: 12.5px; }
th, td { padding: 6px 10px; border-bottom: 1px solid var(--line); text-align: right;
  vertical-align: bottom; white-space: nowrap; }
.word { text-align: left; white-space: normal; }
.default td { font-weight: 700; }
a { color: inherit; text-decoration-color: #b9c0c9; text-underline-offset: 3px; }
.robust { color: #d6361f; } .paper { color: #2f6fb3; }
summary { cursor: pointer; color: var(--faint); font-size: 14px; margin-top: 18px; }
@media (max-width: 760px) { dl { grid-template-columns: 1fr; } main { padding: 32px 14px; } }
@media print { section { break-inside: avoid; border: 0; padding: 0; } }
"""
"""The look: a column as wide as the plots, words in serifs, numbers in tabular figures."""


class Html(str):
    """Markup that goes into the page as it is; all other text is escaped."""


def page(title: str, place: str, lead: str, parts: Iterable[str], footer: str) -> Html:
    """A whole page.

    Args:
        title: The headline.
        place: What made the page.
        lead: A paragraph below the headline.
        parts: What the page is made of.
        footer: A paragraph at the end.
    """
    return Html(
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_html(title)}: {_html(place)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        f'<main>\n<p class="place">{_html(place)}</p>\n<h1>{_html(title)}</h1>\n'
        f'<p class="lead">{_html(lead)}</p>\n'
        + "\n".join(parts)
        + f"\n<footer>{_html(footer)}</footer>\n</main>\n</body>\n</html>\n"
    )


def section(key: str, title: str, *parts: str, place: str = "", aside: str = "") -> Html:
    """A section under a link; `aside` stands beside its title."""
    return Html(
        f'<section id="{_html(key)}">\n'
        + (f'<p class="place">{_html(place)}</p>\n' if place else "")
        + f'<div class="head"><h2>{_html(title)}</h2>{aside}</div>\n'
        + "\n".join(parts)
        + "\n</section>"
    )


def result_section(key: str, result: Result) -> Html:
    """What a benchmark measured: question, chart, what is saved, and all tables below a fold."""
    pieces = [Html(f'<p class="lead">{_html(result.question)}</p>')]
    if result.chart is not None:
        words = f"{key.capitalize()}: time against error"
        pieces.append(picture(embed_figure(result.chart(result)), words, shown=False))
    pieces += [figures(table, result[table]) for table in (RATIOS, SAVINGS) if result[table]]
    tables = "\n".join(
        figures(table, rows)
        for table, rows in result.tables.items()
        if rows and table not in (RATIOS, SAVINGS)
    )
    pieces.append(Html(f"<details><summary>All figures</summary>{tables}</details>"))
    pieces += [note(f"Left out: {line}") for line in left_out_lines(result.skipped)]
    return section(key, key.capitalize(), *pieces, note(f"Took {result.took_s:.0f} s."))


def figures(table: Table, rows: Sequence[Row]) -> Html:
    """A table of figures, with what it says below; what lrf3d does by default is bold."""
    marked = [bool(row.get("default")) for row in rows]
    heads, cells, left = table.grid(rows)
    made = grid(heads, cells, words=left, marked=marked)
    return Html(made + note(table.note)) if table.note else made


def note(text: str) -> Html:
    """A small line."""
    return Html(f'<p class="note">{_html(text)}</p>')


def grid(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    words: int = 1,
    marked: Sequence[bool] = (),
) -> Html:
    """Cells under a head; the first columns hold words, and the others numbers."""

    def cells(kind: str, row: Sequence[str], default: bool = False) -> str:
        made = []
        for column, cell in enumerate(row):
            # Modes have their colours in tables as in figures.
            classes = [cell] if cell in ("robust", "paper") and kind == "td" else []
            classes += ["word"] if column < words else []
            named = f' class="{" ".join(classes)}"' if classes else ""
            made.append(f"<{kind}{named}>{_html(cell)}</{kind}>")
        opening = '<tr class="default">' if default else "<tr>"
        return opening + "".join(made) + "</tr>"

    listed = list(rows)
    flags = marked or [False] * len(listed)
    body = "\n".join(cells("td", row, flag) for row, flag in zip(listed, flags, strict=True))
    return Html(
        f'<div class="scroll"><table><thead>{cells("th", head)}</thead>\n'
        f"<tbody>{body}</tbody></table></div>"
    )


def picture(data: str, caption: str, *, shown: bool = True) -> Html:
    """A picture, given as a data URI; its caption is shown below it, or only read aloud."""
    words = _html(caption)
    below = f"<figcaption>{words}</figcaption>" if shown else ""
    return Html(f'<figure><img src="{data}" alt="{words}">{below}</figure>')


def embed_figure(figure: Figure, *, lines: bool = True) -> str:
    """A figure as a data URI: SVG, or PNG where it is made of too much for lines."""
    file = BytesIO()
    if lines:
        # A fixed salt, so that the same figure gives the same text.
        with rc_context({"svg.hashsalt": "lrf3d"}):
            figure.savefig(file, format="svg", metadata={"Date": None})
    else:
        figure.savefig(file, format="png", dpi=DOTS_PER_INCH)
    return _uri(file, "svg+xml" if lines else "png")


def embed_frame(frame: NDArray[np.uint8]) -> str:
    """A frame (h, w, 3) of a film as a data URI: JPEG."""
    from PIL import Image

    file = BytesIO()
    Image.fromarray(frame).save(file, format="JPEG", quality=QUALITY)
    return _uri(file, "jpeg")


def _uri(file: BytesIO, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(file.getvalue()).decode()}"


def _html(text: str) -> str:
    return text if isinstance(text, Html) else escape(text)
