"""The table of ``bench drive``, as text."""

from lrf3d.study.bench.drive_bench import DriveBenchmark
from lrf3d.study.bench.text import duration, saving_table, table


def drive_text(result: DriveBenchmark) -> str:
    """The benchmark of drives, as a table with what each column means."""
    head = ("inputs", "integrator", "setting", "drive", "quartiles", "off", "heading off", "")
    rows, before = [], ""
    for entry in result.entries:
        timing = entry.timing
        rows.append(
            (
                entry.inputs if entry.inputs != before else "",
                entry.integrator.family,
                entry.integrator.setting,
                duration(timing.median),
                f"{1e3 * timing.low:.3g}–{1e3 * timing.high:.3g} ms" if timing.calls > 1 else "",
                f"{entry.position:.1e} m",
                f"{entry.heading:.1e} rad",
                "default" if entry.integrator.chosen else "",
            )
        )
        before = entry.inputs
    note = (
        f"the pose after {result.driven:g} s of driving against the true one; setting: the step,"
        " or the tolerance\nof RK45; default: what lrf3d.drive does where nothing is said."
    )
    parts = [table(head, rows), note, saving_table(result.savings), f"took {result.took:.0f} s"]
    return "\n\n".join(parts)
