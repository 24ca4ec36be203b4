"""The page of the paper: each claim with what was measured, in one file without outside parts."""

from html import escape

from lrf3d.study.paper.claim import Claim, Picture, Table
from lrf3d.study.paper.report import PAPER, PaperReport

STYLE = """
:root { --ink: #20262e; --faint: #68727f; --line: #e1e5ea; --paper: #fbfaf8; --warm: #d6361f;
  --cool: #2f6fb3; --good: #1d7a55; --fair: #9a6a00; --bad: #b3261e; }
* { box-sizing: border-box; }
html { scroll-behavior: smooth; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 17px/1.6 Charter, "Bitstream Charter", "Sitka Text", Cambria, Georgia, serif; }
main { max-width: 1080px; margin: 0 auto; padding: 64px 32px 96px; }
h1 { font-size: 42px; line-height: 1.15; margin: 0 0 12px; letter-spacing: -0.01em; }
h2 { font-size: 27px; line-height: 1.25; margin: 0; letter-spacing: -0.005em; }
.lead { color: var(--faint); font-size: 19px; max-width: 46em; margin: 0 0 40px; }
.sans, .place, .verdict, th, td, figcaption, dt, footer, .criterion {
  font-family: "Inter", "Helvetica Neue", "Segoe UI", Roboto, "DejaVu Sans", Arial, sans-serif; }
.place { color: var(--faint); font-size: 13px; letter-spacing: 0.02em; margin: 0 0 6px; }
section { background: #fff; border: 1px solid var(--line); border-radius: 10px;
  padding: 36px 40px 28px; margin: 36px 0; }
.head { display: flex; justify-content: space-between; gap: 24px; align-items: flex-start; }
.verdict { flex: none; font-size: 13px; font-weight: 600; padding: 3px 12px; border-radius: 99px;
  border: 1px solid currentColor; white-space: nowrap; }
.good { color: var(--good); } .fair { color: var(--fair); } .bad { color: var(--bad); }
.none { color: var(--faint); }
dl { display: grid; grid-template-columns: 1fr 1fr; gap: 8px 40px; margin: 22px 0 18px; }
dl > div { min-width: 0; }
dt { font-size: 12px; font-weight: 600; text-transform: uppercase; letter-spacing: 0.07em;
  color: var(--faint); margin-bottom: 4px; }
dd { margin: 0; }
.criterion { font-size: 13px; color: var(--faint); margin: 0 0 20px; }
figure { margin: 24px 0 8px; }
figure img { display: block; width: 100%; height: auto; border-radius: 4px; }
figcaption { font-size: 13.5px; color: var(--faint); margin-top: 8px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 14px; margin: 18px 0 6px;
  font-variant-numeric: tabular-nums; }
th { text-align: right; font-weight: 600; color: var(--faint); font-size: 12.5px; }
th, td { padding: 6px 10px; border-bottom: 1px solid var(--line); text-align: right;
  vertical-align: bottom; }
td { white-space: nowrap; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
thead th { border-bottom: 1.5px solid var(--ink); }
tbody tr:last-child td { border-bottom: 0; }
.glance td { white-space: normal; text-align: left; font-size: 15px; }
.glance th { text-align: left; }
.glance td:last-child, .glance th:last-child { text-align: right; white-space: nowrap; }
a { color: inherit; text-decoration-color: #b9c0c9; text-underline-offset: 3px; }
.robust { color: var(--warm); } .paper { color: var(--cool); }
footer { color: var(--faint); font-size: 13px; margin-top: 48px; }
code { font: 0.92em ui-monospace, "SF Mono", Menlo, "DejaVu Sans Mono", monospace; }
@media (max-width: 760px) { dl { grid-template-columns: 1fr; } main { padding: 32px 16px; }
  section { padding: 24px 18px; } .head { flex-direction: column; gap: 10px; }
  main { overflow-wrap: anywhere; } h1 { font-size: 32px; } .verdict { white-space: normal; }
  .glance td:last-child, .glance th:last-child { white-space: normal; }
  .glance td { font-size: 13.5px; } th, td { padding: 6px; } }
@media print { section { break-inside: avoid; border: 0; padding: 0; } body { background: #fff; } }
"""
"""The look: a reading column, figures as wide as it, numbers in tabular figures."""

KINDS = {"holds": "good", "does not hold": "bad", "not measured": "none"}
"""Colours of verdicts; those that hold in one mode lie between."""


def page_text(report: PaperReport) -> str:
    """The page as HTML."""
    claims = report.claims
    whole = sum(claim.verdict == "holds" for claim in claims)
    holding = sum(claim.verdict.startswith("holds") for claim in claims)
    parts = [
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>The paper, redone by lrf3d</title>\n<style>{STYLE}</style>\n</head>\n<body>",
        '<main>\n<p class="place">lrf3d paper</p>\n<h1>The paper, redone</h1>',
        f'<p class="lead">Every figure and claim of {escape(PAPER)}, measured with lrf3d in both'
        ' modes of its mapper: <b class="robust">robust</b>, the default, and'
        ' <b class="paper">paper</b>, the algorithm of the paper to the letter.'
        f" {whole} of {len(claims)} claims hold, {holding - whole} more in one mode or one place."
        " The paper gives no numbers to hold them to, so that each criterion was chosen here.</p>",
        _glance(claims),
        *(_section(number, claim) for number, claim in enumerate(claims, 1)),
        f"<footer>Measured in {report.took:.0f} s on {report.machine['cores']} cores,"
        f" {escape(str(report.machine['system']))}. Length F1 and segment F1 are"
        " harmonic means of precision and recall, along the walls and over matched segments; object"
        " purity is the adjusted Rand index of the map's objects against true objects. ± is half of"
        " the 95 % interval of a mean over seeds. Redo it with <code>lrf3d paper</code>; its"
        " figures stand in <code>paper.json</code> too.</footer>\n</main>\n</body>\n</html>\n",
    ]
    return "\n".join(parts)


def _glance(claims: tuple[Claim, ...]) -> str:
    rows = "\n".join(
        f'<tr><td>{number}</td><td><a href="#{claim.name}">{escape(claim.title)}</a></td>'
        f"<td>{escape(claim.place)}</td><td>{_verdict(claim)}</td></tr>"
        for number, claim in enumerate(claims, 1)
    )
    head = "<tr><th></th><th>The paper says or shows</th><th>where</th><th>measured</th></tr>"
    table = f'<table class="glance"><thead>{head}</thead><tbody>{rows}</tbody></table>'
    return f'<div class="scroll">{table}</div>'


def _section(number: int, claim: Claim) -> str:
    pictures = [_figure(picture) for picture in claim.pictures]
    return "\n".join(
        [
            f'<section id="{claim.name}">\n<p class="place">{number} · {escape(claim.place)}</p>',
            f'<div class="head"><h2>{escape(claim.title)}</h2>{_verdict(claim)}</div>',
            f"<dl><div><dt>The paper</dt><dd>{escape(claim.said)}</dd></div>",
            f"<div><dt>lrf3d</dt><dd>{escape(claim.found)}</dd></div></dl>",
            f'<p class="criterion">It holds when {escape(claim.criterion)}.</p>',
            *(pictures if not claim.tables or len(pictures) > 1 else []),
            *map(_table, claim.tables),
            *(pictures if claim.tables and len(pictures) <= 1 else []),
            "</section>",
        ]
    )


def _verdict(claim: Claim) -> str:
    kind = KINDS.get(claim.verdict, "fair")
    return f'<span class="verdict {kind}">{escape(claim.verdict)}</span>'


def _figure(picture: Picture) -> str:
    caption = escape(picture.caption)
    return (
        f'<figure><img src="{picture.data}" alt="{caption}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(word)}</th>" for word in table.head)
    rows = "".join(
        "<tr>" + "".join(f"<td{_colour(word)}>{escape(word)}</td>" for word in row) + "</tr>\n"
        for row in table.rows
    )
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead>\n'
        f"<tbody>{rows}</tbody></table></div>"
    )


def _colour(word: str) -> str:
    """Modes have their colours in tables as in figures."""
    return f' class="{word}"' if word in ("robust", "paper") else ""
