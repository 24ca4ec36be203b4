"""The tables of ``bench map``, as text."""

from lrf3d.scenario import SIGMA
from lrf3d.study.bench.map_accuracy import USUAL_BEAMS, MapEntry
from lrf3d.study.bench.map_bench import MapBenchmark
from lrf3d.study.bench.text import duration, table


def map_text(result: MapBenchmark) -> str:
    """The benchmark of maps, as tables with what each column means."""
    parts = []
    if result.entries:
        parts += [_settings(result.entries), _notes(result)]
    if result.sizes:
        parts.append(_sizes(result))
    if result.memory:
        parts.append(_memory(result))
    if result.pairs:
        parts.append(_pairs(result))
    if result.skipped:
        parts.append("\n".join(f"left out: {line}" for line in result.skipped))
    return "\n\n".join([*parts, f"took {result.took:.0f} s"])


def _settings(entries: list[MapEntry]) -> str:
    head = (
        "varied", "value", "mode", "segment F1", "length F1", "ratio", "purity", "RMS", "update",
        "map", "seeds",
    )  # fmt: skip
    rows = []
    before = ""
    for entry in entries:
        setting = entry.setting
        rows.append(
            (
                setting.varied if setting.varied != before else "",
                f"{setting.value:g}" + ("" if setting.varied == "beams" else " m"),
                setting.mode,
                *(f"{entry.score(n):.3f}" for n in ("segment_f1", "length_f1")),
                f"{entry.score('segment_ratio'):.2f}",
                f"{entry.score('object_purity'):.3f}",
                f"{1e3 * entry.score('perpendicular_rms'):.1f} mm",
                duration(entry.update.median),
                duration(entry.build),
                f"{len(entry.builds)}",
            )
        )
        before = setting.varied
    return table(head, rows)


def _notes(result: MapBenchmark) -> str:
    return (
        f"city, {result.scans} scans along all of its drive; {USUAL_BEAMS} beams, σ = {SIGMA:g} m"
        " and the mapper's own thresholds\nwhere nothing else is said; the mapper knows σ. ratio:"
        " segments by visible walls. purity: unions\nagainst true objects. RMS: perpendicular"
        " distance from the true walls. update: the median, with the\nseed that was disturbed"
        " least. map: working out the final map, which robust mode does when it is\nlooked at."
    )


def _sizes(result: MapBenchmark) -> str:
    rows = [
        (
            f"{entry.walls:,}",
            entry.mode,
            "" if entry.segments is None else f"{entry.segments:,}",
            *(duration(t) for t in (entry.update.median, entry.update.low, entry.update.high)),
            f"{entry.update.calls}",
        )
        for entry in result.sizes
    ]
    head = ("walls of a town", "mode", "segments", "update", "quartile", "quartile", "updates")
    return table(head, rows)


def _memory(result: MapBenchmark) -> str:
    rows = []
    for entry in result.memory:
        count = entry.count
        rows.append(
            (
                f"city, {entry.scans} scans",
                entry.mode,
                f"{count.segments:,}",
                f"{count.unions:,}",
                f"{count.union_numbers:,}",
                f"{count.polylines:,}",
                f"{count.polyline_numbers:,}",
                f"{count.grid_cells:,}",
            )
        )
    head = (
        "to store", "mode", "segments", "unions", "numbers", "polylines", "numbers",
        "grid of 0.1 m",
    )  # fmt: skip
    return table(head, rows)


def _pairs(result: MapBenchmark) -> str:
    rows = [
        (
            f"{entry.place}, {entry.known:,} lines",
            entry.strategy,
            f"{entry.pairs:.1f}",
            f"{entry.comparisons:,.0f}",
            duration(entry.pairing.median),
            f"{100.0 * entry.same:.4g} %",
        )
        for entry in result.pairs
    ]
    head = ("line pairs", "strategy", "pairs", "comparisons", "time", "scans with the pairs of all")
    return table(head, rows)
