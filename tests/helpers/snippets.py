"""Snippets of Markdown pages, run as a reader would run them, but at small settings.

Python blocks of a page share their names, worlds in TOML become files, and lines of shell blocks
that call lrf3d, or a script that measures, are called. All pages share one folder, and a line that
several pages have is called once.
"""

import re
import runpy
import shlex
import sys
import tomllib
import warnings
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path

import damaged_worlds
import numpy as np
import pytest
from markdown_it import MarkdownIt
from program import lrf3d as called

from benchmarks import paper
from benchmarks.__main__ import PARTS, bench
from benchmarks.report import program
from lrf3d import load_run, load_scenario
from lrf3d.apps.cli.parser import parse
from lrf3d.base.errors import Lrf3dWarning
from lrf3d.recordings.formats.trajectory import save_tum
from stress import command as stress

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]

# Lines of shell that set up lrf3d, or call other programs.
NOT_OURS = re.compile(
    r"git clone |python3 -m venv |\. \.venv|\.venv/bin/pip |pip install |dask "
    r"|python examples/|scripts/(?!bench|paper|stress)"
)

# What lines of shell call.
PROGRAMS = {
    "lrf3d": None,
    "scripts/bench": bench,
    "scripts/paper": program(paper.bench, "scripts/paper", ""),
    "scripts/stress": stress,
}

# What is added to a command; of an option that is given twice the last one holds.
SMALL = {
    "run": "--no-video --set robot.scan_interval=1 --set laser.beams=61",
    "render": "--size 64x64 --fps 1 --playback 4 --workers 1",
    "sweep": "--seeds 1 --workers 1 --resume",
    "scripts/bench slam": "--scans 60 --spacings 0.5",
    "scripts/bench robots": "--robots 8 --seconds 0.1",
    "scripts/bench score": "--seeds 1 --poses 3 --beams 61 --vertices 10",
}

# What is called instead of what takes long, or of what a reader has and a test has not.
INSTEAD = {
    r"\brun city\b": "run paper_room --out out/city",
    r"\bcrosscheck city\b": "crosscheck paper_room",
    r"\blocalise (city|corridor)(?! \w)": "localise paper_room --seeds 1 --workers 1",
    r"\blocalise out/first\b": "localise out/city",
    r"\bbench robots city\b": "bench robots corridor",
    r"--scans \d+": "--scans 60",
    r"generate maze": "generate maze --size 14",
    r"\bsweep city corridor\b": "sweep paper_room --out out/both",
    r"\bsweep (city|corridor)\b": "sweep paper_room",
    r"--scheduler tcp://\S+": "--out out/cluster",
    r"--at \d+": "--at 2",
    r"--to html": "--to html --every 20",
    r"/front/scan": "/scan",
}

# Commands that are parsed and not called, as tests of their own call them: peers and pages take
# their time, and `view` shows its page until it is stopped.
CHECKED = {
    *(f"scripts/bench {part}" for part in PARTS if part not in ("slam", "robots", "score")),
    "ros", "scripts/bench", "scripts/paper", "scripts/stress", "view", "edit",
}  # fmt: skip


@dataclass(frozen=True)
class Snippet:
    """A fenced block of a page: its language, its code, and the line where the code begins."""

    page: Path
    language: str
    code: str
    line: int


def snippets(page):
    """The fenced blocks of a page, in order."""
    return [
        Snippet(page, token.info.strip(), token.content, token.map[0] + 1)
        for token in MarkdownIt().parse(page.read_text(encoding="utf-8"))
        if token.type == "fence"
    ]


@dataclass
class Workshop:
    """The folder that snippets run in, with the files that their readers have."""

    folder: Path
    called: set[str] = field(default_factory=set)

    def prepare(self):
        """Make the run and the recorded drive that pages speak of, and small files to read."""
        self.call("lrf3d run city")
        for name, to in (("drive.log.gz", "carmen"), ("drive.mcap", "mcap")):
            self.call(f"lrf3d export out/city --to {to} --out {name}")
        self.call("lrf3d export out/city --to rosbag2 --out rosbag2_2026_01_31")
        run = load_run("out/city")
        save_tum(run.trajectory.times, run.trajectory.poses, "theirs.tum")
        Path("drive.relations").write_text("0 1 1.0 0.0 0.0\n")
        Path("examples").symlink_to(ROOT / "examples")
        worlds = damaged_worlds.valid()
        for name in ("footprints.geojson", "plan.dxf", "plan.svg", "town.osm"):
            Path(name).write_bytes(next(iter(worlds[name.partition(".")[2]].values())))
        _write_drawing(Path("flat.dxf"))
        _write_scans(Path("scans.npz"))

    def run(self, page):
        """Run all snippets of a page; return what each block of Python printed."""
        names, world, printed = {}, "", []
        for snippet in snippets(page):
            if snippet.language == "python":
                # As many empty lines go before as makes an error name its line of the page.
                code = "\n" * snippet.line + snippet.code
                with redirect_stdout(StringIO()) as said, warnings.catch_warnings():
                    # Where drives are as short as these is known poorly.
                    warnings.simplefilter("ignore", Lrf3dWarning)
                    exec(compile(code, str(page), "exec"), names)
                printed.append(said.getvalue())
            elif snippet.language == "toml":
                # A table that stands alone is one more of the world before it.
                alone = "[[object]]" not in snippet.code
                world = world + snippet.code if alone else snippet.code
                path = Path(tomllib.loads(world)["name"] + ".toml")
                path.write_text(world)
                load_scenario(path)
            elif snippet.language == "sh":
                for line in snippet.code.splitlines():
                    self.shell(line.partition(" #")[0].strip())
        return printed

    def shell(self, line):
        """Call a line of shell that is ours; of the others the scripts must be there."""
        if NOT_OURS.match(line):
            assert not line.startswith("scripts/") or (ROOT / line.split()[0]).is_file()
        elif line.startswith("python "):
            _script(line)
        elif line:
            assert line.split()[0] in PROGRAMS, f"what is {line!r}?"
            self.call(line)

    def call(self, line):
        """Call lrf3d or a script that measures, once for each line."""
        if line in self.called:
            return
        self.called.add(line)
        words = small(line)
        # Drives as short as these are not found on each other, and have few scans.
        if _named(words) in CHECKED or {"--on", "--close"} & set(words):
            _check(words)
            return
        done = called(*words[1:], program=PROGRAMS[words[0]])
        if "--force" in done.stderr:
            # Pages share a folder, which holds results of the one before.
            done = called(*words[1:], "--force", program=PROGRAMS[words[0]])
        assert done.returncode == 0, f"{line}: {done.stdout} {done.stderr}"


def small(line):
    """The words of a line that calls a program, at small settings."""
    for long, short in INSTEAD.items():
        line = re.sub(long, short, line)
    words = shlex.split(line)
    return words + shlex.split(SMALL.get(_named(words), ""))


def _script(line):
    """Run a program of the examples in a world that takes no time."""
    path, *words = shlex.split(line)[1:]
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()):
        patch.setattr(sys, "argv", [path, *(word.replace("city", "corridor") for word in words)])
        runpy.run_path(path, run_name="__main__")


def _named(words):
    """The command that words call, without the name lrf3d; a script has parts, or is one."""
    program, *rest = words
    first = rest[0] if rest and not rest[0].startswith("-") else ""
    if program == "scripts/bench":
        return f"{program} {first}".strip()
    if program != "lrf3d":
        return program
    return " ".join(rest[: 2 if first == "world" else 1])


def _check(words):
    """See that a command takes these words."""
    program, *rest = words
    if program == "lrf3d":
        parse(rest)
    else:
        # A script checks all of its words before it prints its help.
        assert called(*rest, "--help", program=PROGRAMS[program]).returncode == 0


def _write_drawing(path):
    """A room of 8 m by 6 m, drawn in millimetres."""
    import ezdxf

    drawing = ezdxf.new()
    drawing.modelspace().add_lwpolyline([(0, 0), (8e3, 0), (8e3, 6e3), (0, 6e3)], close=True)
    drawing.saveas(path)


def _write_scans(path):
    angles, count = np.linspace(-1.0, 1.0, 41), 3
    np.savez(
        path,
        real_azimuth=np.tile(angles, count),
        real_range=np.tile(4.0 / np.cos(angles), count),
        real_n=np.full(count, len(angles)),
        real_pose=np.zeros((count, 3)),
        real_rlim=np.tile([0.1, 30.0], (count, 1)),
    )
