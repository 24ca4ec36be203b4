"""Damaged and hostile world files end in one clear error, in bounded time and memory."""

import resource
import signal
import subprocess
import sys
from pathlib import Path

import damaged_worlds
import pytest

from lrf3d.errors import WorldError
from lrf3d.world import World, load_world
from lrf3d.world.apart import read_here
from lrf3d.world.files import FORMATS

DAMAGED = dict(damaged_worlds.damaged())
UNREADABLE = dict(damaged_worlds.unreadable())
LONGEST = 5
"""Seconds of a processor after which a file has hung: those of a person who waits."""

MOST_MEMORY = 500 << 10
"""Kilobytes that all files together may add to this process."""


def write(folder: Path, files: dict[str, bytes]) -> Path:
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return folder / next(iter(files))


def read(path: Path) -> World:
    """Read in this process what would be read in one of its own, which takes longer to start."""
    known = FORMATS.get(path.suffix)
    return read_here(path, known.read) if known and known.apart else load_world(path)


@pytest.fixture(autouse=True)
def bounded():
    def hung(*_):
        pytest.fail(f"takes more than {LONGEST} s")

    # Time of the processor: a busy machine is no fault of the file.
    before = signal.signal(signal.SIGPROF, hung)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    yield
    signal.setitimer(signal.ITIMER_PROF, 0)
    signal.signal(signal.SIGPROF, before)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory < MOST_MEMORY


def refusal(path: Path) -> str:
    with pytest.raises(WorldError) as caught:
        read(path)
    message = str(caught.value)
    assert "\n" not in message and str(path.parent) in message and len(message) < 400
    return message


def test_there_are_enough_of_them():
    assert len(DAMAGED) + len(UNREADABLE) >= 450


@pytest.mark.parametrize("kind", damaged_worlds.valid())
def test_what_is_damaged_here_is_a_world_when_whole(kind, tmp_path):
    assert len(load_world(write(tmp_path, damaged_worlds.valid()[kind])).segments) > 2


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_is_read_or_refused_in_one_line(name, tmp_path):
    path = write(tmp_path, DAMAGED[name])
    try:
        assert len(read(path).segments) > 0
    except WorldError:
        refusal(path)


@pytest.mark.parametrize("name", UNREADABLE)
def test_a_hostile_file_is_refused_in_one_line(name, tmp_path):
    refusal(write(tmp_path, UNREADABLE[name]))


@pytest.mark.parametrize(
    "name",
    [
        "toml nan",
        "geojson deep",
        "osm entities",
        "svg uses of uses",
        "dxf a million copies",
        "glb an absolute buffer",
        "ply a huge count",
        "stl noise",
        "map with a huge picture",
        "yaml aliases of aliases",
    ],
)
def test_on_the_command_line_it_is_one_line_and_the_status_1(name, tmp_path):
    path = write(tmp_path, UNREADABLE[name])
    command = [sys.executable, "-m", "lrf3d", "world", "convert", path, tmp_path / "out.toml"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("lrf3d: ") and done.stderr.count("\n") == 1
    assert not (tmp_path / "out.toml").exists()


def test_a_file_that_takes_too_long_is_given_up(tmp_path, monkeypatch):
    path = write(tmp_path, damaged_worlds.valid()["svg"])
    monkeypatch.setattr("lrf3d.world.apart.SLOWEST_MACHINE", 0.001)
    with pytest.raises(WorldError, match=r"a\.svg: takes more than"):
        load_world(path)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("while True: pass", "takes more than"),
        ("[bytes(1 << 24) for _ in range(1 << 10)]", "too much memory"),
        ("os.kill(os.getpid(), 9)", "damaged"),
        ("raise ValueError('a\\nb')", "ValueError: a b"),
        ("print('noise')", "noise.svg: damaged"),
    ],
)
def test_a_reader_that_never_ends_or_dies_is_one_clear_error(body, said, tmp_path, monkeypatch):
    (tmp_path / "evil.py").write_text(
        "import os\nimport lrf3d.world.svg as svg\ndef read(path):\n    " + body + "\n"
        "svg.read_svg = read\n"
    )
    (tmp_path / "sitecustomize.py").write_text("import evil\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    path = write(tmp_path, {"noise.svg": damaged_worlds.SVG.encode()})
    with pytest.raises(WorldError, match=said):
        load_world(path)


def test_a_folder_or_a_link_to_elsewhere_is_no_picture(tmp_path):
    inside = tmp_path / "maps"
    inside.mkdir()
    (tmp_path / "secret.png").write_bytes(damaged_worlds.picture("PNG"))
    (inside / "map.png").symlink_to(tmp_path / "secret.png")
    (inside / "a.yaml").write_text(damaged_worlds.YAML)
    with pytest.raises(WorldError, match="link to elsewhere"):
        load_world(inside / "a.yaml")
