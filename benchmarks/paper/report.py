"""The report of the paper: all claims measured, one after the other."""

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from lrf3d.study.paper.city import (
    city_claim,
    drive_through,
    film_claim,
    speed_claim,
)
from lrf3d.study.paper.claim import MODES, Claim
from lrf3d.study.paper.extent import Extent
from lrf3d.study.paper.memory import grid_claim, polyline_claim
from lrf3d.study.paper.robustness import robustness_claim
from lrf3d.study.paper.room import ROOM, maps_claim, room_sweep, scan_claim
from lrf3d.study.paper.search import localisation_claim, search_claim

from lrf3d.cores import core_count

PAPER = (
    "L. Teslić, I. Škrjanc, G. Klančar: Simulation of a Mobile Robot with a LRF and Map Building"
)
"""What is redone."""


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
        """The report in JSON's types, without pictures."""
        return {
            "paper": PAPER,
            "claims": [claim.as_dict() for claim in self.claims],
            "machine": self.machine,
            "took_s": self.took,
        }


def redo_paper(
    extent: Extent | None = None,
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> PaperReport:
    """Measure every claim of the paper.

    Args:
        extent: How much is measured; the usual where not given.
        progress: Called with the steps that are done and all.
    """
    extent = Extent() if extent is None else extent
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
        partial(maps_claim, *swept),
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
    machine = {"system": platform.platform(), "cores": core_count()}
    return PaperReport(found, machine, time.perf_counter() - begin)


STEPS = 1 + 2 * len(MODES) + 10
"""Steps that progress is told in: the sweep, the drives and the claims."""
