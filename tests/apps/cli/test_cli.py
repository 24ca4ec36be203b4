import json
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from program import lrf3d, ran, refused
from waiting import until

from lrf3d import InputError, export_run, load_scenario, save_run
from lrf3d.apps.cli.commands import COMMANDS
from lrf3d.apps.cli.parser import _parser, lists, parse
from lrf3d.base.formats import FORMATS

ROOM = """\
name = "box"

[[object]]
name = "walls"
points = [[0, 0], [10, 0], [10, 8], [0, 8]]
closed = true

[robot]
route = [[2, 2], [8, 2], [8, 6]]
speed = 2.0
scan_interval = 0.5

[laser]
beams = 61
range_max = 20.0

[noise]
sigma = 0.05
"""


@pytest.fixture
def room(written):
    return written("box.toml", ROOM)


def test_run_writes_its_files_and_json_is_the_only_output(room, tmp_path):
    command = [sys.executable, "-m", "lrf3d", "run", room, "--no-video", "--json"]
    done = subprocess.run([*command, "--out", tmp_path / "out"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    summary = json.loads(done.stdout)
    assert summary == json.loads((tmp_path / "out" / "summary.json").read_text())
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"run.npz", "map.geojson", "map.png", "world.png", "summary.json"}
    assert set(summary["files"].values()) == written
    assert summary["map"]["segments"] == 4 and summary["buildings"]["whole"] == 1


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="closes streams as a shell does")
@pytest.mark.parametrize("closed", ["2>&-", "<&- >&- 2>&-"])
def test_streams_that_the_shell_has_closed_lose_nothing(room, tmp_path, closed):
    words = f'"{sys.executable}" -m lrf3d run {room} --scans 2 --no-video --out out {closed}'
    assert subprocess.run(["sh", "-c", words], cwd=tmp_path).returncode == 0
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"run.npz", "map.geojson", "map.png", "world.png", "summary.json"}


@pytest.mark.slow
def test_a_picture_that_fails_loses_nothing_and_says_so_in_one_line(room, tmp_path):
    out = tmp_path / "an out"
    # A folder stands where the picture should go.
    (out / "world.png" / "full").mkdir(parents=True)
    done = lrf3d("run", room, "--out", out, "--scans", 3, "--json", "--size", "64x64", "--fps", 2)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1 and f"{out / 'world.png'}: not drawn: " in done.stderr
    assert "all scans kept; go on with --resume" in done.stderr
    summary = json.loads((out / "summary.json").read_text())
    assert json.loads(done.stdout) == summary and "map picture" in summary["files"]
    assert "world picture" not in summary["files"] and (out / "run.npz").exists()
    # What comes after it is drawn.
    assert (out / summary["files"]["video"]).exists()


def test_a_plan_as_large_as_paper_has_no_walls_to_find_and_a_small_file(tmp_path):
    text = ROOM.replace("10", "0.1").replace("8]", "0.08]").replace("sigma = 0.05", "sigma = 0")
    route = re.search("route = .*\nspeed = .*\nscan_interval = .*", text)
    (tmp_path / "paper.toml").write_text(text.replace(route[0], "poses = [[0.05, 0.04, 0]]"))
    done = ran("run", "paper.toml", "--no-video", cwd=tmp_path)
    assert ": no wall is long enough to be looked for\n" in done.stdout
    done = lrf3d("export", "out/box", "--to", "carmen", cwd=tmp_path)
    assert re.search(r"size +0\.[1-9] kB\n", done.stdout)


def test_several_noises_stand_side_by_side(room, tmp_path):
    sigmas = ("--sigma=0.02,0.2", "--sigma", 0.3, 0.4, "--")
    done = ran("run", "--no-video", "--json", "--scans", 3, *sigmas, room, cwd=tmp_path)
    levels = json.loads(done.stdout)["noise_levels"]
    assert [level["sigma_m"] for level in levels] == [0.02, 0.2, 0.3, 0.4]
    assert (tmp_path / "out" / "box" / "noise.png").exists()


def test_names_may_begin_with_a_dash_and_are_not_empty():
    args = parse(["slam", "--out", "there", "--", "-dash.csv"])
    assert args.log == Path("-dash.csv") and args.out == Path("there")
    with pytest.raises(InputError, match="--out: '': expected a path"):
        parse(["slam", "drive.log", "--out", ""])


@pytest.mark.parametrize("command", [[], ["run"], ["map"], ["world", "show"]])
def test_help_shows_an_example(command):
    done = ran(*command, "-h")
    assert done.stdout == lrf3d(*command, "--help").stdout
    assert "Example: lrf3d" in done.stdout


def test_an_unknown_name_is_reported_before_anything_heavy_is_imported():
    code = """
import sys
from lrf3d.apps.cli import main
commands = "run", "render", "view", "sweep", "export --to glb", "slam", "slam a.log --relations"
for words in commands:
    name = "missing.log" if words.startswith("slam") else "nowhere"
    sys.argv = ["lrf3d", *words.split(), name]
    try:
        main()
    except SystemExit as end:
        print(end.code, words, {"numba", "scipy.sparse", "matplotlib"} & {*sys.modules})
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    said = done.stdout.splitlines()
    assert len(said) == 7 == done.stderr.count("\n")
    assert all(line.startswith("1 ") and line.endswith(" set()") for line in said), said


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[[object]]", "[[object", "box.toml: not TOML: "),
        ("[8, 2]", "[8, -2]", "wall 0"),
    ],
)
def test_a_bad_world_gets_one_clear_line_and_leaves_nothing(room, tmp_path, old, new, said):
    assert old in ROOM
    room.write_text(ROOM.replace(old, new))
    assert said in refused("run", room, "--no-video", "--out", tmp_path / "out")
    assert not list((tmp_path / "out").glob("*"))


def test_a_collision_can_be_ignored(room, tmp_path):
    room.write_text(ROOM.replace("[8, 2]", "[8, -2]"))
    done = ran("run", room, "--no-video", "--ignore-collisions", "--out", tmp_path / "out")
    assert "warning" in done.stderr and "wall 0" in done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "usage: lrf3d COMMAND"),
        ("fly", "there is no 'fly'; known are run, render"),
        ("world shaw", "did you mean 'world show'?"),
        ("run", "required: WORLD"),
        ("run city --sede 3", "there is no '--sede'; did you mean '--seed'?"),
        ("run city --speed 2", "did you mean '--set robot.speed=VALUE'?"),
        ("run city --beam 91", "did you mean '--set laser.beams=VALUE'?"),
        ("run city --max-range 8", "did you mean '--set laser.range_max=VALUE'?"),
        ("run city --duration 8", "did you mean '--scans'?"),
        ("run city --random-seed 8", "did you mean '--seed'?"),
        ("render out/city --play-back 8", "did you mean '--playback'?"),
        ("sweep city --runs 8", "did you mean '--seeds'?"),
        ("map a.log --max-range 8", "there is no '--max-range'; see lrf3d map -h"),
        ("run city --xyzzy", "there is no '--xyzzy'; see lrf3d run -h"),
        ("run city --mode best", "--mode: 'best': expected robust or paper"),
        ("run city --sigma much", "--sigma: 'much': expected a number from 0"),
        ("run city --scans 0", "--scans: '0': expected a whole number from 1"),
        ("run city --size 641x361", "--size: '641x361': expected WIDTHxHEIGHT"),
        (f"run city --size 640x{5000 * '9'}", "expected WIDTHxHEIGHT"),
        ("map drive.log --sigma 0.1 0.2", "unexpected 0.2"),
        ("export out/city", "required: --to"),
        ("sweep city --shard 3/2", "--shard: '3/2': expected I/N"),
        ("sweep city --sigma ,", "--sigma: ',': expected a number from 0"),
        ("sweep city --mapper rubust", "--mapper: 'rubust': expected robust, paper or FILE.py:"),
    ],
)
def test_wrong_usage_ends_with_two_and_one_line_that_says_what_is_wrong(words, said):
    done = lrf3d(*words.split())
    assert (done.returncode, done.stdout) == (2, "") and said in done.stderr
    assert done.stderr.count("\n") == 1 or not words


DIGITS = "9" * 5000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "ROOM", "--set", f"laser.range_max={DIGITS}"], "laser.range_max"),
        (["run", "ROOM", "--set", f"laser.range_max=0x{DIGITS}"], "thousands of digits"),
        (["run", "ROOM", "--set", "noise.sigma=" + "[" * 5000], "not a TOML value"),
        (["sweep", "ROOM", "--vary", f"noise.sigma=0x{DIGITS}"], "thousands of digits"),
        (["run", "ROOM", "--set", "robot.speed=1e-309"], "drive faster"),
        (["run", "n" * 300 + ".toml"], "too long"),
        (["run", "ROOM", "--out", "n" * 300], "too long"),
        (["run", "ROOM", "--out", "box.toml/out"], "--out"),
        (["run", "ROOM", "--scans", "1" + 12 * "0"], "from 1 to 10,000,000"),
        (["run", "ROOM", "--resume", "--out", "full"], "run.journal: a folder"),
        (["run", "ROOM", "--set", "noise.drop_outs=2"], ": noise: drop-outs: share 2.0"),
    ],
)
def test_what_no_file_and_no_number_can_be_is_one_line(room, tmp_path, arguments, words):
    (tmp_path / "full" / "run.journal").mkdir(parents=True)
    arguments = [str(room) if each == "ROOM" else each for each in arguments]
    assert words in refused(*arguments, cwd=tmp_path)


@pytest.mark.slow
def test_output_that_cannot_be_written_or_shown_is_no_traceback(room, tmp_path):
    command = [sys.executable, "-m", "lrf3d", "world", "show"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (
        1,
        "lrf3d: standard output: No space left on device\n",
    )
    command = [sys.executable, "-m", "lrf3d", "run", str(room), "--no-video", "--sigma", "0.04"]
    command += ["--sigma", "0.1", "--out", str(tmp_path / "out")]
    environment = {**os.environ, "PYTHONIOENCODING": "latin-1"}
    done = subprocess.run(command, capture_output=True, env=environment)
    assert (done.returncode, done.stderr) == (0, b"")
    assert rb"\u03c3 0.1 m" in done.stdout


@pytest.mark.slow
def test_a_termination_is_obeyed_as_ctrl_c_and_what_is_ignored_stays_so(room, tmp_path):
    room.write_text(ROOM.replace("scan_interval = 0.5", "scan_interval = 0.0005"))
    command = [sys.executable, "-m", "lrf3d", "run", room, "--no-video", "--out", tmp_path / "out"]
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    finally:
        signal.signal(signal.SIGHUP, before)
    until(lambda: (tmp_path / "out" / "run.journal").exists() or process.poll() is not None)
    process.send_signal(signal.SIGHUP)
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 143
    assert re.fullmatch(r"lrf3d: stopped(; .* scans kept; go on with --resume)?\n", err)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("view out --set robot.radius=1 --page 2", "--set, --page: out is a run"),
        ("view paper_room --playback=2", "--playback: paper_room is a world"),
        ("render out --at 1 --from 0", "--from: of a film"),
        ("localise paper_room --out there", "--out: of a recorded drive; give a LOG"),
        ("localise out out/run.log.gz --seeds 3", "--seeds: of simulated drives"),
        ("run city --sigma 0.1 --set noise.sigma=1", "--sigma --set noise.sigma: given twice"),
        ("run paper_room --sigma 0.1 0.2 --noise a:b", "--sigma: --noise takes its place"),
        ("sweep paper_room --vary mapper.gap=1 --vary mapper.gap=2", "--vary mapper.gap: given"),
        ("sweep paper_room --merge --shard 1/2", "--shard: --merge makes no runs"),
        ("map out/run.log.gz --part 2", "run.log.gz: no bag, so that there is no part to choose"),
    ],
)
def test_an_option_that_would_change_nothing_is_refused(words, said, tmp_path):
    run = load_scenario("paper_room").run(rng=0, scans=2)
    (tmp_path / "out").mkdir()
    save_run(run, tmp_path / "out" / "run.npz")
    export_run(run, "carmen", tmp_path / "out" / "run.log.gz")
    assert said in refused(*words.split(), cwd=tmp_path)


def test_a_message_is_one_line_however_a_file_is_called(tmp_path):
    said = refused("world", "show", "no\nsuch\x1b[31m" + "x" * 100 + ".toml", cwd=tmp_path)
    assert r"no\nsuch\x1b[31m" in said and len(said) < 1000


def test_what_libraries_warn_of_does_not_reach_the_terminal(room, tmp_path):
    (tmp_path / "warner.py").write_text(
        "import logging, warnings\n"
        "class Mapper:\n"
        "    def update(self, scan):\n"
        "        warnings.warn_explicit('loud', RuntimeWarning, 'library.py', 1, 'library')\n"
        "        logging.getLogger('library').error('louder')\n"
    )
    named = ("--mapper", "warner.py:Mapper", "--no-video", "--scans", 2)
    done = ran("run", room, *named, cwd=tmp_path)
    assert done.stderr == ""


def test_the_next_command_can_be_typed_whatever_the_folder_is_called(room, tmp_path):
    out = tmp_path / "it's mine"
    done = lrf3d("run", room, "--no-video", "--scans", 2, "--out", out)
    words = shlex.split(done.stdout.splitlines()[-1])
    assert words == ["next", "lrf3d", "render", str(out)]


def test_a_warning_stands_once_and_a_start_in_a_box_is_called_so(tmp_path):
    box = "[[object]]\npoints = [[4, 3], [6, 3], [6, 5], [4, 5]]\nclosed = true\n\n[robot]"
    world = ROOM.replace("[robot]", box).replace(
        "route = [[2, 2], [8, 2], [8, 6]]", "start = [5, 4, 0]"
    )
    (tmp_path / "w.toml").write_text(world)
    done = lrf3d("run", "w.toml", "--no-video", "--scans", 2, "-o", "out", cwd=tmp_path)
    assert done.stderr.count("(5, 4) is inside a closed shape of 2.0 m by 2.0 m") == 1


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["re"], ["render"]),
        (["run", "city", "--sc"], ["--scale", "--scans"]),
        (["world", "sh"], ["show"]),
        (["world", "show", "city", "--tr"], ["--trees"]),
        (["run", "--mode", "p"], ["paper"]),
    ],
)
def test_a_shell_completes_commands_options_and_choices(words, expected):
    script = lrf3d("completion", "bash").stdout
    typed = f"COMP_WORDS=(lrf3d {' '.join(words)}); COMP_CWORD={len(words)}; _lrf3d"
    command = ["bash", "-c", f'{script}{typed}; echo "${{COMPREPLY[@]}}"']
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert sorted(done.stdout.split()) == expected


@pytest.mark.parametrize(
    ("command", "kinds"), [("world convert", ("world", "picture", "drawing")), ("map", ("log",))]
)
def test_what_a_format_can_be_told_is_an_option_of_the_command(command, kinds):
    _, options = _parser(command)
    known = {flag for option in options for flag in option.names}
    told = {name for row in FORMATS if row.kind in kinds for name in row.options}
    assert told and {f"--{name.replace('_', '-')}" for name in told} <= known


def test_a_help_text_holds_no_other_option():
    pages = {name: [option for _, found in lists(name) for option in found] for name in COMMANDS}
    held = [(name, one.names) for name in pages for one in pages[name] if ": " in one.help
            and re.search(r"(?:^| )--[a-z-]+(?: [A-Z]+)?: ", one.help)]  # fmt: skip
    assert held == []
