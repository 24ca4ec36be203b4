"""A sweep gives each run once, and the same, wherever, whenever and in whatever order."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet
from typer.testing import CliRunner

from lrf3d.cli.app import app
from lrf3d.errors import InputError
from lrf3d.output import draw_all
from lrf3d.scenario_file import load_scenario
from lrf3d.sweep import sweeping
from lrf3d.sweep.drawing import curves_of, figures_of, table_text
from lrf3d.sweep.grid import SweepGrid, parse_axis, parse_values, read_grid
from lrf3d.sweep.plan import digest, make_plan, seed_of
from lrf3d.sweep.store import PARTS, TABLE, Store
from lrf3d.sweep.summary import Mean, cell_means, summarise
from lrf3d.sweep.sweeping import LARGEST_BATCH, Batches, sweep
from lrf3d.sweep.task import carry_out, run_of, unpack

ROOM = """\
[[object]]
points = [[0, 0], [10, 0], [10, 8], [0, 8]]
closed = true

[robot]
poses = [[2, 2, 0], [8, 6, 180]]

[laser]
range_max = 20.0
"""


@pytest.fixture
def room(tmp_path):
    path = tmp_path / "box.toml"
    path.write_text(ROOM)
    return str(path)


def tiny(room, *, seeds=3, **axes):
    """A plan of a few very small runs."""
    chosen = {"noise.sigma": (0.0, 0.3), "laser.beams": (31, 61), **axes}
    return make_plan(SweepGrid.usual(room, axes=chosen, seeds=seeds))


def done_here(plan, folder, *, order=1):
    """The table of a plan whose runs are all made in this process, in one order or its reverse."""
    with Store(folder, plan) as store:
        for run in plan.runs[::order]:
            place = unpack(plan.places[plan.cells[run.cell].place].packed())
            store.add(carry_out(place, [run.order]).rows)
        store.finish()
    return (folder / TABLE).read_bytes()


@pytest.mark.slow
def test_a_cluster_gives_what_one_process_gives_in_any_order_bit_for_bit(room, tmp_path):
    plan = tiny(room)
    assert len(plan.runs) == 2 * 2 * 2 * 3
    here = done_here(plan, tmp_path / "here")
    heard = []
    result = sweep(plan, tmp_path / "there", workers=2, progress=lambda *step: heard.append(step))
    assert here == done_here(plan, tmp_path / "back", order=-1)
    assert here == (tmp_path / "there" / TABLE).read_bytes()
    assert not (tmp_path / "there" / PARTS).exists()
    assert result.resumed == 0 and heard[0] == (0, 24) and heard[-1] == (24, 24)
    rows = parquet.read_table(tmp_path / "there" / TABLE).to_pylist()
    assert [row["key"] for row in rows] == [run.order.key for run in plan.runs]
    assert len({row["key"] for row in rows}) == 24


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_no_run_and_gives_none_twice(room, tmp_path, monkeypatch):
    plan = tiny(room, seeds=20)
    monkeypatch.setattr("lrf3d.sweep.sweeping.BATCH_SECONDS", 0.01)
    killed = []
    connected = sweeping.connected

    class Connected:
        """Kills a worker at the start and another when some runs are done."""

        def __init__(self, scheduler, workers):
            self._inner = connected(scheduler, workers)

        def __enter__(self):
            self.client = self._inner.__enter__()
            return self.client

        def __exit__(self, *error):
            return self._inner.__exit__(*error)

    held = Connected(None, 2)
    monkeypatch.setattr(sweeping, "connected", lambda *_: held)

    def kill(done, total):
        if len(killed) < 2 and done >= 10 + 40 * len(killed):
            pids = set(held.client.run(os.getpid).values()) - set(killed)
            if pids:
                killed.append(min(pids))
                os.kill(killed[-1], signal.SIGKILL)

    result = sweep(plan, tmp_path / "killed", progress=kill)
    assert len(killed) == 2 and len(result.rows) == len(plan.runs)
    assert (tmp_path / "killed" / TABLE).read_bytes() == done_here(plan, tmp_path / "here")


def test_a_sweep_that_was_stopped_goes_on_and_ends_as_if_it_had_not_been(room, tmp_path):
    plan = tiny(room)

    def stop(done, total):
        if done >= 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(plan, tmp_path / "out", workers=1, progress=stop)
    kept = [len(parquet.read_table(part)) for part in (tmp_path / "out" / PARTS).iterdir()]
    assert 5 <= sum(kept) < 24
    with pytest.raises(InputError, match="--resume"):
        sweep(plan, tmp_path / "out", workers=1)
    result = sweep(plan, tmp_path / "out", workers=1, resume=True)
    assert result.resumed == sum(kept)
    assert (tmp_path / "out" / TABLE).read_bytes() == done_here(plan, tmp_path / "here")


def test_more_seeds_add_to_what_is_there_and_fewer_throw_nothing_away(room, tmp_path):
    few, more = tiny(room, seeds=1), tiny(room, seeds=2)
    done_here(few, tmp_path / "out")
    with Store(tmp_path / "out", more, resume=True) as store:
        assert len(store) == 8
        for run in more.runs:
            place = more.places[more.cells[run.cell].place]
            store.add(carry_out(place, [run.order]).rows)
        store.finish()
    done_here(more, tmp_path / "whole")
    assert (tmp_path / "out" / TABLE).read_bytes() == (tmp_path / "whole" / TABLE).read_bytes()
    with pytest.raises(InputError, match="8 runs that this sweep does not ask for"):
        Store(tmp_path / "out", few, resume=True)


def test_one_folder_has_one_writer_and_only_tables_of_sweeps(room, tmp_path):
    plan = tiny(room)
    with (
        Store(tmp_path / "out", plan),
        pytest.raises(InputError, match=r"out: process \d+ writes here"),
    ):
        Store(tmp_path / "out", plan, resume=True)
    (tmp_path / "out" / TABLE).write_bytes(b"no parquet")
    with pytest.raises(InputError, match=r"sweep\.parquet: not a table of a sweep or damaged"):
        Store(tmp_path / "out", plan, resume=True)


@pytest.mark.slow
def test_a_scheduler_started_by_hand_gives_the_same(room, tmp_path):
    plan = tiny(room)
    ready = tmp_path / "scheduler.json"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    code = "from dask.__main__ import main; main()"
    python = [sys.executable, "-c", code]
    scheduler = subprocess.Popen(
        [*python, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
         "--scheduler-file", str(ready)], **quiet
    )  # fmt: skip
    workers = [
        subprocess.Popen(
            [*python, "worker", "--scheduler-file", str(ready), "--nthreads", "1",
             "--no-nanny", "--no-dashboard", "--host", "127.0.0.1"], **quiet
        )
        for _ in range(2)
    ]  # fmt: skip
    try:
        from distributed import Client

        with Client(scheduler_file=str(ready), timeout=60) as client:
            client.wait_for_workers(2, timeout=60)
            address = client.scheduler.address
        sweep(plan, tmp_path / "there", scheduler=address)
    finally:
        for process in (*workers, scheduler):
            process.terminate()
            process.wait(30)
    assert (tmp_path / "there" / TABLE).read_bytes() == done_here(plan, tmp_path / "here")


def test_a_row_can_be_run_again_by_its_seed(room, tmp_path):
    plan = tiny(room)
    run = plan.runs[-1]
    row = carry_out(plan.places[plan.cells[run.cell].place], [run.order]).rows[0]
    told = plan.described(run)
    scenario = load_scenario(room, [f"laser.beams={told['beams']}"])
    again = scenario.run(
        mode=told["mode"], sigma=told["sigma_m"], rng=told["noise_seed"], caster="planar"
    )
    assert row["map_segments"] == len(again.map)
    place = plan.places[plan.cells[run.cell].place]
    np.testing.assert_array_equal(run_of(place, run.order).ranges, again.ranges)


def test_modes_and_noises_are_given_one_draw_and_seeds_and_beams_others(room):
    plan = tiny(room)
    seeds = {}
    for run in plan.runs:
        told = plan.described(run)
        seeds.setdefault((told["beams"], told["seed"]), set()).add(told["noise_seed"])
    assert all(len(each) == 1 for each in seeds.values())
    assert len(set.union(*seeds.values())) == len(seeds) == 6


def test_keys_come_from_what_a_world_holds_and_not_from_where_it_lies(room, tmp_path):
    elsewhere = tmp_path / "else" / "box.toml"
    elsewhere.parent.mkdir()
    elsewhere.write_text("# The same room.\n" + ROOM)
    keys = [run.order.key for run in tiny(room).runs]
    assert keys == [run.order.key for run in tiny(str(elsewhere)).runs]
    elsewhere.write_text(ROOM.replace("[10, 8]", "[10, 8.5]"))
    assert not set(keys) & {run.order.key for run in tiny(str(elsewhere)).runs}
    with pytest.raises(InputError, match="another world of the sweep is called box"):
        make_plan(SweepGrid((room, str(elsewhere)), seeds=1))


def test_digests_tell_values_apart_and_no_others():
    array = np.array([[1.0, 2.0], [3.0, -0.0]])
    assert digest(array) == digest(np.asfortranarray(array.copy())) == digest(array + 0.0)
    assert digest(array) != digest(array.T) != digest(array[:1])
    assert digest({"b": 1, "a": (2, "x")}) == digest({"a": [2, "x"], "b": 1})
    assert 0 <= seed_of("x") < 2**63 and seed_of("x") != seed_of("y")


def test_batches_hold_every_run_once_and_grow_where_runs_are_short(room):
    plan = tiny(room, seeds=400)
    batches = Batches(plan.runs, plan.cells, workers=2)
    sizes, seen = [], []
    while (batch := batches.take()) is not None:
        assert {plan.cells[run.cell].place for run in batch.runs} == {batch.place}
        batches.learn(batch, 1e-3 * len(batch.runs))
        sizes.append(len(batch.runs))
        seen += batch.runs
    assert seen == list(plan.runs)
    assert sizes[0] == 1 and max(sizes) == LARGEST_BATCH and sizes[-1] == 1


def test_a_grid_file_says_what_flags_say(room, tmp_path):
    path = tmp_path / "grid.toml"
    path.write_text(
        'worlds = ["box.toml"]\nseeds = 2\nevery = 3\n[noise]\nsigma = [0, 0.5]\n'
        '[mapper]\nmode = "paper"\ngap = [1, 2.5]\n'
    )
    grid = read_grid(path, {})
    assert grid.worlds == (room,) and (grid.seeds, grid.every) == (2, 3)
    assert grid.axes == {
        "mapper.mode": ("paper",), "noise.sigma": (0.0, 0.5), "mapper.gap": (1.0, 2.5),
    }  # fmt: skip
    over = read_grid(path, dict([parse_axis("mapper.gap=4")]), seeds=5)
    assert over.axes["mapper.gap"] == (4.0,) and over.seeds == 5
    assert len(make_plan(grid).runs) == 2 * 2 * 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sede = 3", "grid.toml: there is no 'sede'; did you mean 'seeds'"),
        ("seeds = 0", "grid.toml: sweep: seeds is 0"),
        ('worlds = "city"', "grid.toml: worlds: expected a list"),
        ("[noise]\nsigmas = [1]", "there is no 'sigmas'; did you mean 'sigma'"),
        ("[noise]\nsigma = [-1]", "setting noise.sigma: expected a finite number of at least 0"),
        ("[noise]\nsigma = [1, 1.0]", "noise.sigma has a value twice"),
        ("[noise]\nsigma = []", "noise.sigma has no value"),
        ("[robot]\nroute = [[[0, 0], [1, 1]]]", "only single values can be varied"),
        ("noise = 5", r"noise: expected a table \[noise\], found 5"),
        ("[noise]\nsigma = [2020-01-01]", "only single values can be varied"),
        (f"[noise]\nsigma = [0x{'9' * 5000}]", "a number of thousands of digits"),
        (f"[noise]\nsigma = [{'9' * 5000}]", "grid.toml: .*digits"),
        (f"seeds = 0x{'9' * 5000}", "seeds is a number of thousands of digits, expected 1 to"),
        ("noise]", "grid.toml: .*line 1"),
    ],
)
def test_a_grid_that_is_none_is_refused_with_the_place(tmp_path, text, message):
    path = tmp_path / "grid.toml"
    path.write_text(text if "worlds" in text else f'worlds = ["city"]\n{text}')
    with pytest.raises(InputError, match=message.replace("line 1", "line 2")):
        read_grid(path, {})


def test_values_are_numbers_words_and_nothing_else():
    assert parse_values("0, 0.5,true,paper", "--vary") == (0, 0.5, True, "paper")
    for wrong in ("mapper.gap", "=1"):
        with pytest.raises(InputError):
            SweepGrid(("city",), dict([parse_axis(wrong)]))


def test_numbers_are_written_as_run_takes_them():
    assert parse_values(".04, 1., 2e-3, robust", "--sigma") == (0.04, 1.0, 0.002, "robust")


def test_more_runs_than_can_be_made_are_refused_before_they_are_planned(room):
    with pytest.raises(InputError, match=r"2 settings with 900000 .* 1,800,000 runs"):
        SweepGrid((room,), {"noise.sigma": (0.1, 0.2)}, seeds=900_000)


def test_a_drive_that_is_thinned_to_one_scan_is_warned_of():
    said = []
    make_plan(SweepGrid(("paper_room",), {}, seeds=1, every=100), warn=said.append)
    assert len(said) == 1 and "paper_room: one scan in 100 leaves one of" in said[0]
    make_plan(SweepGrid(("paper_room",), {}, seeds=1, every=2), warn=said.append)
    assert len(said) == 1


def test_means_have_the_interval_of_student(room, tmp_path):
    mean = Mean.of([1.0, 2.0, 4.0, None])
    # Tables give t = 4.3027 for two degrees of freedom.
    assert mean.mean == pytest.approx(7.0 / 3.0) and mean.runs == 3
    assert mean.half == pytest.approx(4.302653 * np.sqrt(7.0 / 3.0 / 3.0), rel=1e-6)
    assert Mean.of([0.5]).as_dict() == {"mean": 0.5, "low": None, "high": None, "runs": 1}
    assert Mean.of([None]).as_dict()["mean"] is None


def test_summary_figures_and_table_tell_every_combination(room, tmp_path):
    plan = tiny(room)
    done_here(plan, tmp_path / "out")
    rows = parquet.read_table(tmp_path / "out" / TABLE).to_pylist()
    summary = json.loads(json.dumps(summarise(plan, rows), allow_nan=False))
    assert summary["runs"] == 24 and len(summary["combinations"]) == 8
    assert summary["combinations"][0]["length_f1"]["runs"] == 3
    for mean in cell_means(plan, rows):
        mine = [r["length_f1"] for r in rows if mean.columns.items() <= r.items()]
        assert len(mine) == 3 and mean.measures["length_f1"].mean == pytest.approx(np.mean(mine))
    files, failed = draw_all(figures_of(plan, rows, tmp_path / "out"), "")
    assert {path.name for path in files.values()} == {"box_sigma.png", "box_beams.png"}
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in files.values())
    assert failed == ""
    assert len(table_text(plan, rows).splitlines()) == 1 + 8 + 2
    curves, averaged = curves_of(cell_means(plan, rows), "sigma_m", plan)
    assert not averaged and len(curves) == 4 and curves[0].x == (0.0, 0.3)


@pytest.mark.slow
def test_the_command_writes_its_files_and_prints_one_object(room, tmp_path):
    command = [
        sys.executable, "-m", "lrf3d", "sweep", room, "--sigma", "0.1", "--beams", "31", "--seeds",
        "2", "--workers", "1", "--out", str(tmp_path / "out"), "--json",
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    assert json.loads(done.stdout)["runs"] == 4
    written = {path.name for path in Path(tmp_path / "out").iterdir()}
    assert written == {"sweep.parquet", "summary.json"}
    again = subprocess.run([*command, "--resume"], capture_output=True, text=True, timeout=120)
    assert again.stdout == done.stdout
    for flags, words in (
        (["--scheduler", "localhost"], "expected an address such as tcp://"),
        (["--vary", "mapper.gap"], "expected TABLE.KEY=VALUE"),
        (["--sigma", ","], "--sigma ',': expected values"),
    ):
        with pytest.raises(InputError, match=re.escape(words)):
            CliRunner().invoke(app, [*command[3:], *flags], catch_exceptions=False)
    with pytest.raises(InputError, match="no world; name one"):
        CliRunner().invoke(app, ["sweep"], catch_exceptions=False)


def test_a_killed_process_that_takes_long_to_go_is_no_error(room, tmp_path, monkeypatch):
    from distributed.process import AsyncProcess

    join, waits = AsyncProcess.join, []

    async def slow(self, timeout=None):
        # As on a machine with many other processes: not gone within Dask's time.
        waits.append(timeout)
        if timeout is not None and timeout <= 5.0:
            raise TimeoutError
        await join(self, timeout)

    monkeypatch.setattr(AsyncProcess, "join", slow)
    result = sweep(tiny(room), tmp_path / "out", workers=1)
    assert len(result.rows) > 0
    assert len(waits) == 3 and waits[2] > 5.0


def test_processes_that_cannot_be_started_are_one_clear_error(room, tmp_path, monkeypatch):
    from lrf3d.errors import Lrf3dError
    from lrf3d.sweep import cluster

    def fails(**_):
        raise RuntimeError("Cluster failed to start:\nno room")

    monkeypatch.setattr(cluster, "LocalCluster", fails)
    with pytest.raises(Lrf3dError, match="cannot be started: Cluster failed to start: no room"):
        sweep(tiny(room), tmp_path / "out", workers=2)
