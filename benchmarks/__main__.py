"""``scripts/bench``: run time against error, of everything or of one part."""

from argparse import ArgumentParser
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from benchmarks.report import program
from lrf3d.apps.cli import main
from lrf3d.apps.cli.console import print_json, say

PARTS = {
    "ranges": "scripts/bench ranges --walls 400,10000 --figure ranges.png",
    "lidar": "scripts/bench lidar --seconds 4",
    "clouds": "scripts/bench clouds --figure clouds.png",
    "maps": "scripts/bench maps --seeds 1 --figure maps.png",
    "drive": "scripts/bench drive --figure drive.png",
    "slam": "scripts/bench slam --figure slam.png",
    "frames": "scripts/bench frames --figure frames.png",
    "light": "scripts/bench light --seeds 3",
    "robots": "scripts/bench robots --robots 1024",
    "growth": "scripts/bench growth --figure growth.png",
    "warnings": "scripts/bench warnings --scans 120",
    "score": "scripts/bench score footprints.geojson --beams 181 --seeds 2",
}
"""The parts, with an example of each."""

QUICK = {
    "ranges": "--walls 40 --seconds 0.1",
    "lidar": "--seconds 0.05 --walls 500 --robots 8 --beams 20000",
    "clouds": "--layers 8 --noises 20 --scans 4",
    "maps": "--seeds 1 --every 80 --scans 20",
    "drive": "--seconds 5",
    "slam": "--scans 40 --spacings 0.5",
    "frames": "--buildings 40 --seconds 0.2 --width 160",
    "light": "--world paper_room --poses 3 --seconds 0.2",
    "robots": "corridor --robots 4 --seconds 0.1",
    "growth": "--most 100",
    "warnings": "--scans 12",
    "score": "corridor --seeds 1 --poses 3 --beams 61",
}
"""Arguments of each part in a form of a few seconds, which shows that it works."""

ALONE = [part for part in PARTS if part != "score"]
"""Those that need no file."""


def bench(words: Sequence[str]) -> None:
    """Measure a part; all that need no file if none is named."""
    if words and words[0] in PARTS:
        # Only the part that is measured is imported.
        part, *rest = words
        measure = import_module(f"benchmarks.{part}").bench
        program(measure, f"scripts/bench {part}", PARTS[part], QUICK[part])(rest)
        return
    parser = ArgumentParser(
        prog="scripts/bench",
        description=f"Measure run time against error, of all or of a part: {', '.join(PARTS)}.",
        epilog="Example: scripts/bench ranges --json; scripts/bench PART -h shows its options,"
        " scripts/bench PART --quick takes a few seconds.",
    )
    parser.add_argument("--json", action="store_true", help="Print one JSON value.")
    as_json = parser.parse_args(words).json
    found: dict[str, Any] = {}
    for name in ALONE:
        say(f"bench {name}")
        report = import_module(f"benchmarks.{name}").bench()
        found[name] = report.as_dict()
        if not as_json:
            print(report.text(), end="\n\n", flush=True)
    if as_json:
        print_json(found)


if __name__ == "__main__":
    main(bench, "scripts/bench")
