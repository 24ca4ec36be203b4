"""The report of the paper: all claims measured, one after the other, and its page."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from html import escape
from typing import Any

from benchmarks.map.settings import MODES
from benchmarks.page import Html, figures, grid, note, page, picture, section
from benchmarks.paper.city import city_claim, drive_through, film_claim, speed_claim
from benchmarks.paper.claim import Claim, Extent
from benchmarks.paper.room import ROOM, maps_claim, robustness_claim, room_sweep, scan_claim
from benchmarks.paper.use import grid_claim, localisation_claim, polyline_claim, search_claim
from benchmarks.result import as_json, this_machine
from lrf3d.progress import Progress, silent

PAPER = (
    "L. Teslić, I. Škrjanc, G. Klančar: Simulation of a Mobile Robot with a LRF and Map Building"
)
"""What is redone."""

STEPS = 1 + 2 * len(MODES) + 10
"""Steps of the progress: the sweep, the drives and the claims."""

USUAL = Extent()
"""How much is measured if not given."""

KINDS = {"holds": "good", "does not hold": "bad", "not measured": "none"}
"""Colours of verdicts; those that hold in one mode lie between."""


@dataclass(frozen=True)
class PaperReport:
    """What came of every claim.

    Args:
        claims: The claims, in the order of the paper.
        machine: What it was measured on.
        took: How long it took [s].
    """

    claims: tuple[Claim, ...]
    machine: dict[str, Any]
    took: float

    def as_dict(self) -> dict[str, Any]:
        """The report in JSON's types."""
        found: dict[str, Any] = as_json(
            {
                "paper": PAPER,
                "claims": self.claims,
                "machine": self.machine,
                "took_s": self.took,
            }
        )
        return found


def redo_paper(extent: Extent = USUAL, *, progress: Progress = silent) -> PaperReport:
    """Measure every claim of the paper.

    Args:
        extent: How much is measured.
        progress: Called with the steps that are done and all.
    """
    begin = time.perf_counter()
    steps = iter(range(1, STEPS + 1))

    def step(work: Callable[[], Any]) -> Any:
        result = work()
        progress(next(steps), STEPS)
        return result

    # Loading what was compiled is no part of an update.
    for mode in MODES:
        drive_through("city", mode, scans=2)
    swept = step(partial(room_sweep, extent))
    room = {mode: step(partial(drive_through, ROOM, mode)) for mode in MODES}
    city = {mode: step(partial(drive_through, "city", mode, scans=extent.scans)) for mode in MODES}
    claims: tuple[Callable[[], Claim], ...] = (
        partial(scan_claim, extent),
        partial(maps_claim, swept),
        partial(robustness_claim, swept, extent),
        partial(grid_claim, city, room),
        partial(polyline_claim, city, room),
        partial(film_claim, city["robust"], extent),
        partial(city_claim, city),
        partial(search_claim, city["robust"], extent),
        partial(localisation_claim, city["robust"], extent),
        partial(speed_claim, city),
    )
    found = tuple(step(claim) for claim in claims)
    return PaperReport(found, this_machine(), time.perf_counter() - begin)


def page_text(report: PaperReport) -> str:
    """The report as a page."""
    claims = report.claims
    whole = sum(claim.verdict == "holds" for claim in claims)
    holding = sum(claim.verdict.startswith("holds") for claim in claims)
    rows = [
        [
            str(number),
            Html(f'<a href="#{claim.name}">{escape(claim.title)}</a>'),
            claim.place,
            _verdict(claim),
        ]
        for number, claim in enumerate(claims, 1)
    ]
    return page(
        "The paper, redone",
        "scripts/paper",
        Html(
            f"Every figure and claim of {escape(PAPER)}, measured with lrf3d in both"
            ' modes of its mapper: <b class="robust">robust</b>, the default, and'
            ' <b class="paper">paper</b>, the algorithm of the paper to the letter.'
            f" {whole} of {len(claims)} claims hold, {holding - whole} more in one mode or one"
            " place. The paper gives no numbers to compare them with, so that each criterion was"
            " chosen here."
        ),
        [
            grid(("", "The paper says or shows", "where", "measured"), rows, words=3),
            *(_section(number, claim) for number, claim in enumerate(claims, 1)),
        ],
        Html(
            f"Measured in {report.took:.0f} s on {report.machine['cores']} cores,"
            f" {escape(str(report.machine['system']))}. Length F1 and segment F1 are"
            " harmonic means of precision and recall, along the walls and over matched segments;"
            " object purity is the adjusted Rand index of unions against true objects. ± is half"
            " of the 95 % interval of a mean over seeds. Redo it with <code>scripts/paper</code>;"
            " its figures stand in <code>paper.json</code> too."
        ),
    )


def _section(number: int, claim: Claim) -> Html:
    pictures = [picture(each.data, each.caption) for each in claim.pictures]
    tables = [figures(table, rows) for table, rows in claim.tables]
    # One picture explains the table above it; several are what the table sums up.
    parts = pictures + tables if len(pictures) > 1 else tables + pictures
    return section(
        claim.name,
        claim.title,
        Html(
            f"<dl><div><dt>The paper</dt><dd>{escape(claim.said)}</dd></div>"
            f"<div><dt>lrf3d</dt><dd>{escape(claim.found)}</dd></div></dl>"
        ),
        note(f"It holds when {claim.criterion}."),
        *parts,
        place=f"{number} · {claim.place}",
        aside=_verdict(claim),
    )


def _verdict(claim: Claim) -> Html:
    kind = KINDS.get(claim.verdict, "fair")
    return Html(f'<span class="verdict {kind}">{escape(claim.verdict)}</span>')
