"""Robustness: how the error of a map grows with the noise, in the room and in the city."""

from collections.abc import Mapping, Sequence

from benchmarks.page import embed_figure
from benchmarks.paper.claim import MODES, Claim, Extent, Picture, Table
from benchmarks.paper.room import swept
from lrf3d.render.sweep_figure import draw_sweep
from lrf3d.study.sweep.drawing import curves_of
from lrf3d.study.sweep.grid import Grid
from lrf3d.study.sweep.plan import Plan
from lrf3d.study.sweep.summary import CONFIDENCE, CellMean, cell_means
from lrf3d.study.sweep.task import Row

ENOUGH = 0.8
"""Least length F1 of a map that is still one."""

FIGURES = (
    ("length_f1", 1.0, 2), ("segment_f1", 1.0, 2), ("perpendicular_rms", 1e3, 1),
    ("object_purity", 1.0, 2),
)  # fmt: skip
"""Figures of the table, what they are multiplied by, and their decimals."""


def robustness_claim(room: tuple[Plan, list[Row]], extent: Extent) -> Claim:
    """Scores over the noise.

    Args:
        room: The sweep of the room.
        extent: How much is measured in the city.
    """
    city = swept(Grid.usual("city", axes={}, seeds=extent.city_seeds, every=extent.every))
    means = {name: cell_means(*each) for name, each in (("room", room), ("city", city))}
    pictures = [
        _picture(name, plan, means[name]) for name, (plan, _) in (("room", room), ("city", city))
    ]
    worst = {(place, mode): _last(means[place], mode) for place in means for mode in MODES}
    sigma = max(float(mean.columns["sigma_m"]) for mean in means["room"])
    f1 = {key: mean.measures["length_f1"].mean for key, mean in worst.items()}
    rms = {key: 1e3 * mean.measures["perpendicular_rms"].mean for key, mean in worst.items()}
    return Claim(
        "robustness",
        "The mapping is robust, even at a lot of noise",
        "Sections 2.3 and 4",
        "“The experiments shows that our mapping algorithm is robust, even at a lot of noise from"
        " the LRF.” The noise grows with the distance, so that robustness can be tested without"
        " knowing the real distribution of the noise.",
        f"At σ = {sigma:g} m the map of the room keeps a length F1 of {f1['room', 'robust']:.2f}"
        f" in robust mode and {f1['room', 'paper']:.2f} in paper mode; right parts of walls lie"
        f" {rms['room', 'robust']:.0f} and {rms['room', 'paper']:.0f} mm from the true ones."
        f" In the city it is {f1['city', 'robust']:.2f} and {f1['city', 'paper']:.2f}."
        " A sample of the map counts as right within 0.1 m and 5° of a true wall, whatever"
        " the noise.",
        f"the mean length F1 in the room is at least {ENOUGH:g} up to σ = {sigma:g} m",
        {
            mode: all(
                mean.measures["length_f1"].mean >= ENOUGH
                for mean in means["room"]
                if mean.columns["mode"] == mode
            )
            for mode in MODES
        },
        (_table(means),),
        tuple(pictures),
        {
            place: [
                {**mean.columns, **{n: m.as_dict() for n, m in mean.measures.items()}}
                for mean in some
            ]
            for place, some in means.items()
        },
    )


def _last(means: Sequence[CellMean], mode: str) -> CellMean:
    mine = [mean for mean in means if mean.columns["mode"] == mode]
    return max(mine, key=lambda mean: float(mean.columns["sigma_m"]))


def _picture(name: str, plan: Plan, means: Sequence[CellMean]) -> Picture:
    curves, _ = curves_of(means, "sigma_m", plan)
    lrf = next(iter(plan.places.values())).scenario.lrf
    scans = len(next(iter(plan.places.values())).trajectory)
    words = (
        f"{scans} scans of {lrf.beams} beams  ·  {plan.grid.seeds} seeds  ·  mean and its"
        f" {100.0 * CONFIDENCE:g} % interval"
    )
    figure = draw_sweep(
        curves,
        axis=f"noise σ at range_max = {lrf.range_max:g} m [m]",
        titles=(f"The {name} over the noise", words),
    )
    return Picture(
        embed_figure(figure), f"Error of the maps of the {name} over the noise, both modes."
    )


def _table(means: Mapping[str, Sequence[CellMean]]) -> Table:
    """The modes side by side, a row for each noise."""
    rows = []
    for place, some in means.items():
        for sigma in sorted({float(mean.columns["sigma_m"]) for mean in some}):
            at = {m.columns["mode"]: m.measures for m in some if m.columns["sigma_m"] == sigma}
            told = [
                f"{factor * at[mode][name].mean:.{digits}f}"
                for name, factor, digits in FIGURES
                for mode in MODES
            ]
            rows.append((place, f"{sigma:g} m", *told))
    head = ("length F1", "segment F1", "RMS [mm]", "purity")
    columns = (f"{name}, {mode}" for name in head for mode in MODES)
    return Table(("place", "noise σ", *columns), tuple(rows))
