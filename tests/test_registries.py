"""What each kind of noise, reader, mode of the mapper and mark keeps, over all that are entered."""

from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from test_render import room_run

import lrf3d
from lrf3d import (
    InputError,
    LaserRangeFinder,
    LaserScan,
    LineMapper,
    PlanarCaster,
    World,
    WorldError,
)
from lrf3d.base import formats
from lrf3d.base.formats import Format
from lrf3d.laser import Chain, Limits
from lrf3d.laser.imperfections import NOISES
from lrf3d.laser.scan import LIGHT, ScanBatch
from lrf3d.mapping.mapper import MODES
from lrf3d.recordings import LaserLog
from lrf3d.studio.page.message import part_of
from lrf3d.studio.scene.cameras import overview
from lrf3d.studio.scene.moments import MARKS, Scene
from lrf3d.studio.scene.shapes import Lines, level_lines
from lrf3d.studio.scene.timeline import Timeline

LRF = LaserRangeFinder(-1.0, 1.0, 101, range_min=0.5, range_max=20.0)
WALL = PlanarCaster(World([[4.0, -50, 4.0, 50]])).cast(LRF, (0, 0, 0))
EDGE = PlanarCaster(World([[5.0, -50, 5, 0], [10, 0, 10, 50]])).cast(LRF, (0, 0, 0))
KINDS = {"/".join(keys): make(None, *[0.05] * len(keys)) for keys, make in NOISES.items()}
EVERY_NOISE = {**KINDS, "limits": Limits()}


def keeps(noise):
    """What did not return stays so, its scan is left alone, and draws do not depend on it."""
    ranges = [np.inf, -np.inf, np.inf, 3.0, np.inf]
    scan = LaserScan((0, 0, 0), np.linspace(-1, 1, 5), ranges, range_max=20.0)
    for seed in range(50):
        after = noise(scan, np.random.default_rng(seed)).ranges
        assert np.isposinf(after[[0, 2, 4]]).all() and after[1] == -np.inf
        assert not np.isnan(after).any()
    assert scan.ranges.tolist() == ranges
    one, other = np.random.default_rng(5), np.random.default_rng(5)
    assert np.array_equal(noise(WALL, one).ranges, noise(WALL, 5).ranges)
    noise(EDGE, other)
    assert one.random() == other.random()


@pytest.mark.parametrize("name", EVERY_NOISE)
def test_every_noise_keeps_what_did_not_return_and_draws_as_much_whatever_is_seen(name):
    keeps(EVERY_NOISE[name])


@pytest.mark.parametrize("name", EVERY_NOISE)
def test_every_noise_takes_many_scans_at_once_as_one_after_the_other(name):
    noise, little = EVERY_NOISE[name], np.resize([np.inf, 0.6, -np.inf, 19.9], 101)
    dark = WALL, EDGE, replace(WALL, ranges=little), EDGE
    lit = [replace(scan, intensities=np.linspace(0.1, 0.9, 101)) for scan in dark]
    far = EDGE.ranges[:, None] + [0.0, 0.5]
    # The further echoes of all are drawn after their ranges: only one scan has the same numbers.
    echoing = replace(lit[1], echoes=far, echo_intensities=np.full((101, 2), 0.4))
    for scans in (dark, lit, [echoing]):
        one, other = np.random.default_rng(3), np.random.default_rng(3)
        chain = Chain([noise])
        together = chain(ScanBatch.of(scans), one)
        alone = ScanBatch.of([chain(scan, other) for scan in scans])
        assert chain.batched and one.random() == other.random()
        for part in ("ranges", "walls", *LIGHT):
            assert np.array_equal(getattr(together, part), getattr(alone, part))


@dataclass(frozen=True)
class Bias:
    offset: float

    def __call__(self, scan, rng):
        return replace(scan, ranges=np.maximum(scan.ranges + self.offset, 0.0))


def test_a_noise_that_makes_ranges_of_what_was_too_near_is_found_out():
    with pytest.raises(AssertionError):
        keeps(Bias(0.1))


def test_a_noise_that_is_entered_has_a_key_in_world_files(monkeypatch, written):
    monkeypatch.setitem(NOISES, ("bias",), lambda lrf, offset: Bias(offset))
    file = written(
        "w.toml", "[[object]]\npoints = [[5, -9], [5, 9]]\n[noise]\nsigma = 0\nbias = 0.25\n"
    )
    assert lrf3d.load_scenario(file).noise(WALL, 0).ranges[50] == WALL.ranges[50] + 0.25
    assert lrf3d.load_scenario(file, ["noise.bias=0.5"]).noise(WALL, 0).ranges[50] == 4.5
    with pytest.raises(InputError, match="did you mean 'bias'"):
        lrf3d.load_scenario(file, ["noise.bais=0.5"])


# Endings of installed readers, of which the first is that of a format of lrf3d.
ENDS = (".toml", ".own")


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("content", [b"", b"\x00\xff" * 500, b"a word " * 99, b"{" * 99])
@pytest.mark.parametrize("ending", formats.endings(*formats.WORLDS))
def test_every_reader_refuses_what_is_no_file_of_its_own_in_one_line_that_names_it(ending, content):
    path = Path(f"w{ending}")
    path.write_bytes(content)
    options = {"resolution": 0.05} if ending in formats.endings("picture") else {}
    with pytest.raises(WorldError) as refused:
        lrf3d.load_world(path, **options)
    assert str(refused.value).startswith(str(path)) and "\n" not in str(refused.value)


def enter(monkeypatch, *rows):
    monkeypatch.setattr(formats, "FORMATS", [*formats.FORMATS, *rows])


def test_every_function_that_a_format_names_is_there():
    targets = {each for row in formats.FORMATS for each in (row.read, row.write) if each}
    assert all(callable(formats.function(each)) for each in targets) and len(targets) > 20


def test_a_log_format_that_is_entered_is_read_by_its_ending_or_its_first_bytes(monkeypatch):
    def read_own(intake, poses):
        return LaserLog(f"{intake.path.name} by {poses}", [WALL])

    row = {"kind": "log", "name": "own", "read": read_own, "options": ("poses",)}
    enter(monkeypatch, Format(**row, endings=(".own",), looks={b"OWN 1": "an own log"}))
    for name in ("a.own", "a.log"):
        Path(name).write_bytes(b"OWN 1\n")
        assert lrf3d.load_log(name, poses="odom").name == f"{name} by odom"
    Path("a.bin").write_bytes(b"\0")
    with pytest.raises(InputError, match=r"not a log: it looks like no text; .*\.mat, \.own$"):
        lrf3d.load_log("a.bin")


def test_a_world_format_that_is_entered_is_read_written_and_listed_with_its_options(monkeypatch):
    def read_rows(path, turned=False):
        return World(np.loadtxt(path, ndmin=2)[:, [1, 0, 3, 2] if turned else [0, 1, 2, 3]])

    def write_rows(world, path):
        np.savetxt(path, world.segments, "%g")

    own = {"kind": "world", "endings": (".rows",), "options": ("turned",), "largest": 100}
    enter(monkeypatch, Format(**own, read=read_rows, write=write_rows))
    lrf3d.save_world(World([[0, 0, 4, 1], [4, 0, 4, 3]]), "a.rows")
    assert lrf3d.load_scenario("a.rows").world.segments.tolist() == [[0, 0, 4, 1], [4, 0, 4, 3]]
    assert lrf3d.load_world("a.rows", scale=2.0).segments.tolist() == [[0, 0, 8, 2], [8, 0, 8, 6]]
    assert lrf3d.load_world("a.rows", turned=True).segments.tolist()[0] == [0, 0, 1, 4]
    for content, said in (("0 0 4\n", "damaged"), ("0 0 4 0\n" * 99, "more than")):
        Path("b.rows").write_text(content)
        with pytest.raises(InputError, match=f"^b.rows.*({said})"):
            lrf3d.load_world("b.rows")
    for name, options, said in (
        ("city", {"turned": True}, r"city\.toml: turned is for \.rows files alone"),
        ("city", {"layer": ["A"]}, "did you mean 'layers'"),
        ("c.unknown", {}, r"\.rows"),
    ):
        with pytest.raises(InputError, match=said):
            lrf3d.load_world(name, **options)
    enter(monkeypatch, Format(**own, read=np.loadtxt))
    with pytest.raises(InputError, match="expected a World"):
        lrf3d.load_world("a.rows")


def test_installed_packages_enter_readers_of_worlds_but_replace_none(monkeypatch):
    installed = [metadata.EntryPoint(end, "json:load", "lrf3d.world.readers") for end in ENDS]
    monkeypatch.setattr(metadata, "entry_points", lambda group: installed)
    enter(monkeypatch)
    before = [*formats.FORMATS]
    formats.enter_installed.__wrapped__()
    assert formats.FORMATS[:-1] == before and formats.FORMATS[-1].endings == (".own",)


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_of_the_mapper_shows_what_was_seen_and_nothing_else(mode):
    mapper = LineMapper(mode)
    assert len(mapper.map) == 0
    mapper.update(replace(WALL, ranges=np.full(101, np.inf), walls=np.full(101, -1)))
    assert len(mapper.map) == 0
    mapper.update(WALL)
    before = mapper.map
    assert before is mapper.map and len(before) == 1
    assert np.abs(before.segments[0, [0, 2]] - 4.0).max() < 0.05
    held = before.segments.copy()
    mapper.update(EDGE)
    assert np.array_equal(before.segments, held) and not before.segments.flags.writeable
    after = mapper.map
    assert after is not before and np.isfinite(after.segments).all()
    assert len(after.segments) == len(after.objects) == len(after.points)
    assert len(mapper.local_map(EDGE)) == 2


def test_every_mark_is_drawn_as_it_is_and_the_same_while_nothing_changes(monkeypatch):
    def cross(scene, moment):
        x, y, _ = moment.pose - [*scene.origin, 0.0]
        ends = np.array([[x - 1, y], [x + 1, y]])
        return level_lines(0.5, ends[:1], ends[1:], np.ones((1, 3)), np.ones((1, 2)), 2.0)

    monkeypatch.setitem(MARKS, "cross", cross)
    timeline = Timeline(room_run(), playback=1.0)
    scene = Scene(timeline, goal=(2.0, 2.0, 0.5))
    moment = timeline.moment(0.6 * timeline.end)
    view = overview(timeline, scene.structures).look(moment.time, 1.5)
    with pytest.raises(InputError, match=r"mark 'cross'.*define it in a module"):
        lrf3d.render_video(scene.run, "run.gif", size=(64, 64), renderer="embree")
    marks, again = (dict(scene.seen(moment, view, (90, 60)).marks) for _ in range(2))
    assert {"cross", "goal", "shadow", "trail", "points"} <= set(marks)
    for name, mark in marks.items():
        style, columns = part_of(mark)
        assert isinstance(style["kind"], str) and len({len(each) for each in columns.values()}) == 1
        for key, column in columns.items():
            assert column.dtype == np.float32 and column.flags.c_contiguous, (name, key)
            assert np.isfinite(column).all(), (name, key)
        shown = [mark.colours, *([mark.opacities] if isinstance(mark, Lines) else [])]
        assert all(((each >= 0.0) & (each[..., 3:] <= 1.0).all()).all() for each in shown), name
    assert all(again[name] is marks[name] for name in ("goal", "beams", "points", "bands"))
