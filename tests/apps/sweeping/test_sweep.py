"""A sweep gives each run once, and the same, wherever, whenever and in whatever order."""

import csv
import json
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import pytest
from program import lrf3d as program
from program import refused

import lrf3d
from lrf3d.apps.sweeping.plan import SIGMA, USUAL, make_plan
from lrf3d.apps.sweeping.running import executor_of, run_plan
from lrf3d.apps.sweeping.table import figures_of, mean_of
from lrf3d.base.digest import digest, seed_of
from lrf3d.simulation.scenario import load_scenario, read_scenario_file
from lrf3d.studio.figures.sweep_figure import draw_sweep

ROOM = """\
[[object]]
points = [[0, 0], [10, 0], [10, 8], [0, 8]]
closed = true

[robot]
poses = [[2, 2, 0], [8, 6, 180]]

[laser]
range_max = 20.0
"""


class OneWall:
    """A mapper that finds the same wall in every world."""

    def __init__(self):
        self.map = lrf3d.LineMap([[0, 0, 1, 0]], [0], [2])

    def update(self, scan):
        pass


@pytest.fixture
def room(written):
    return str(written("box.toml", ROOM))


def tiny(room, *, seeds=3, axes=None, mappers=None):
    """A plan of a few very small runs."""
    chosen = {"noise.sigma": (0.0, 0.3), "laser.beams": (31, 61), **(axes or {})}
    return make_plan([read_scenario_file(room)], chosen, mappers or USUAL, seeds)


@pytest.mark.slow
def test_processes_and_this_process_give_the_same_rows_in_the_order_of_the_plan(room, tmp_path):
    plan = tiny(room)
    assert len(plan.runs) == 2 * 2 * 2 * 3
    heard = []
    here = run_plan(plan, tmp_path / "here", None)
    with executor_of(2) as executor:
        there = run_plan(
            plan, tmp_path / "there", executor, progress=lambda *step: heard.append(step)
        )
    assert here.rows == there.rows and here.made == there.made == 24
    assert heard[0] == (0, 24) and heard[-1] == (24, 24)
    assert [row["key"] for row in here.rows] == [run.key for run in plan.runs]
    assert len({row["key"] for row in here.rows}) == 24


@pytest.mark.slow
def test_a_dask_scheduler_gives_the_same(room, tmp_path):
    plan = tiny(room, seeds=1)
    ready = tmp_path / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    python = [sys.executable, "-c", "from dask.__main__ import main; main()"]
    started = [
        subprocess.Popen([*python, *arguments, "--host", "127.0.0.1", "--no-dashboard",
                          "--scheduler-file", str(ready)], env=environment, **quiet)
        for arguments in (["scheduler", "--port", "0"], ["worker", "--no-nanny"])
    ]  # fmt: skip
    try:
        from distributed import Client

        with Client(scheduler_file=str(ready), timeout=300) as client:
            client.wait_for_workers(1, timeout=300)
            address = client.scheduler.address
        with executor_of(None, address) as executor:
            there = run_plan(plan, tmp_path / "there", executor)
    finally:
        for process in started:
            process.terminate()
            process.wait(300)
    assert there.rows == run_plan(plan, tmp_path / "here", None).rows


def test_a_sweep_that_was_stopped_goes_on_and_ends_as_if_it_had_not_been(room, tmp_path):
    plan = tiny(room)

    def stop(done, total):
        if done >= 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as stopped:
        run_plan(plan, tmp_path / "out", None, progress=stop)
    assert stopped.value.__notes__ == ["5 of 24 runs kept; go on with --resume"]
    with pytest.raises(lrf3d.InputError, match="--resume"):
        run_plan(plan, tmp_path / "out", None)
    # What a crash cut off is made again.
    rows = tmp_path / "out" / "sweep.jsonl"
    rows.write_bytes(rows.read_bytes()[:-20])
    result = run_plan(plan, tmp_path / "out", None, resume=True)
    assert result.made == 20
    assert result.rows == run_plan(plan, tmp_path / "here", None).rows


def test_a_process_that_ends_is_one_clear_error(room, tmp_path):
    class Broken(ThreadPoolExecutor):
        def submit(self, *_):
            return super().submit(self._fail)

        def _fail(self):
            raise BrokenProcessPool

    with Broken(1) as executor, pytest.raises(lrf3d.Lrf3dError, match="go on with --resume"):
        run_plan(tiny(room), tmp_path / "out", executor)


def test_more_seeds_add_to_what_is_there_and_fewer_throw_nothing_away(room, tmp_path):
    few, more = tiny(room, seeds=1), tiny(room, seeds=2)
    run_plan(few, tmp_path / "out", None)
    result = run_plan(more, tmp_path / "out", None, resume=True)
    assert result.made == 8 and result.rows == run_plan(more, tmp_path / "whole", None).rows
    for other in (few, tiny(room, seeds=2, mappers={"ours": "robust", "paper": "paper"})):
        with pytest.raises(lrf3d.InputError, match="8 runs that this sweep does not ask for"):
            run_plan(other, tmp_path / "out", None, resume=True)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *[("segment_f1", each) for each in ('"1"', "[1]", "1e999", "NaN", "{}", "{")],
        ("world", '"another"'),
        ("map_objects", '"<svg>"'),
        ("segment_ratio", None),
    ],
)
def test_a_row_whose_measures_cannot_be_is_refused(name, value, room, tmp_path):
    plan = tiny(room, seeds=1)
    run_plan(plan, tmp_path, None)
    path = tmp_path / "sweep.jsonl"
    first, second, *_ = path.read_text().splitlines()
    text = json.dumps({key: each for key, each in json.loads(second).items() if key != name})
    text = text if value is None else f'{text[:-1]}, "{name}": {value}}}'
    path.write_text(f"{first}\n{text}\n")
    with pytest.raises(lrf3d.InputError, match=r"sweep\.jsonl: line 2 is not a row"):
        run_plan(plan, tmp_path, None, resume=True)


def test_no_name_is_a_command_in_a_table_or_leads_out_of_the_folder(room, written, tmp_path):
    for number, name in enumerate(["=1+1\\\\input{x}$^&_#%~", "[2cm]*", "../../-x\\n\\n@y"]):
        path = written(f"{number}.toml", f'name = "{name}"\n{ROOM}')
        result = run_plan(tiny(str(path), seeds=1), tmp_path / str(number), None)
        result.to_latex(tmp_path / "a.tex")
        result.to_csv(tmp_path / "a.csv")
        cell = (tmp_path / "a.tex").read_text().splitlines()[4].split(" & ")[0]
        plain = re.sub(r"\\text\w+\{\}|\\[&%$#_{}]|\{[\[\]*]\}", "", cell)
        assert not set(plain) & set("\\&%$#_{}~^[]*"), cell
        with (tmp_path / "a.csv").open(newline="") as file:
            assert next(csv.DictReader(file))["world"][0] in "'[."
        assert not any("/" in name for name, _ in figures_of(result).values())


def test_own_mappers_are_scored_next_to_ours(room, tmp_path):
    mappers = {"ours": {"mode": "robust"}, "a class": OneWall, "an object": OneWall()}
    table = lrf3d.sweep(room, mappers=mappers, axes={SIGMA: (0.1,)}, seeds=2, workers=1)
    assert [row["mapper"] for row in table.rows] == [name for name in mappers for _ in "ab"]
    assert {row["map_segments"] for row in table.rows if row["mapper"] != "ours"} == {1}
    found = {mean["mapper"]: mean["length_f1"]["mean"] for mean in table.means}
    assert found["ours"] > 0.9 > found["a class"] == found["an object"]
    table.to_csv(tmp_path / "means.csv")
    with (tmp_path / "means.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [line["mapper"] for line in lines] == list(mappers)
    assert float(lines[0]["length_f1"]) == found["ours"]
    table.to_latex(tmp_path / "means.tex")
    text = (tmp_path / "means.tex").read_text()
    assert text.count(r"\\") == 4 and r" \pm " in text and r"\begin{tabular}" in text


def test_a_row_can_be_run_again_by_its_seed(room, tmp_path):
    row = run_plan(tiny(room), tmp_path, None).rows[-1]
    again = load_scenario(room, [f"laser.beams={row['beams']}"]).run(
        mode=row["mapper"], sigma=row["sigma_m"], rng=row["noise_seed"], caster="planar"
    )
    assert row["map_segments"] == len(again.map)
    assert row["length_f1"] == lrf3d.score_run(again).length_f1


def test_mappers_and_noises_are_given_one_draw_and_seeds_and_beams_others(room):
    plan = tiny(room)
    seeds = {}
    for run in plan.runs:
        row = run.columns
        seeds.setdefault((row["beams"], row["seed"]), set()).add(row["noise_seed"])
    assert all(len(each) == 1 for each in seeds.values())
    assert len(set.union(*seeds.values())) == len(seeds) == 6


def test_keys_come_from_what_a_world_holds_and_not_from_where_it_lies(room, tmp_path):
    elsewhere = tmp_path / "else" / "box.toml"
    elsewhere.parent.mkdir()
    elsewhere.write_text("# The same room.\n" + ROOM)
    keys = [run.key for run in tiny(room).runs]
    assert keys == [run.key for run in tiny(str(elsewhere)).runs]
    for old, new in (("[10, 8]", "[10, 8.5]"), ("closed =", 'material = "brick"\nclosed =')):
        elsewhere.write_text(ROOM.replace(old, new))
        assert not set(keys) & {run.key for run in tiny(str(elsewhere)).runs}
    with pytest.raises(lrf3d.InputError, match="worlds has a value twice: box, box"):
        lrf3d.sweep((room, str(elsewhere)), seeds=1)


def test_digests_distinguish_values_by_their_contents():
    array = np.array([[1.0, 2.0], [3.0, -0.0]])
    assert digest(array) == digest(np.asfortranarray(array.copy())) == digest(array + 0.0)
    assert digest(array) != digest(array.T) != digest(array[:1])
    assert digest({"b": 1, "a": (2, "x")}) == digest({"a": [2, "x"], "b": 1})
    assert 0 <= seed_of("x") < 2**63 and seed_of("x") != seed_of("y")


@pytest.mark.parametrize(
    ("axes", "settings", "message"),
    [
        ({}, {"seeds": 0}, "sweep: seeds 0: expected"),
        ({"noise.sigmas": [1]}, {}, "there is no 'sigmas'; did you mean 'sigma'"),
        ({SIGMA: [-1]}, {}, "sigma"),
        ({SIGMA: [1, 1.0]}, {}, "noise.sigma has a value twice"),
        ({"robot.route": [[[0, 0], [1, 1]]]}, {}, "only single values can be varied"),
        ({"mapper.mode": ["paper"]}, {}, "vary it by --mapper"),
        ({SIGMA: [0.1, 0.2]}, {"seeds": 900_000}, "3,600,000 runs with 900,000 seeds"),
        ({}, {"mappers": {"x": "rubust"}}, "expected (paper, robust|robust, paper)"),
        ({}, {"mappers": {"x": 5}}, "has no method update"),
    ],
)
def test_what_cannot_be_swept_is_refused_with_the_place(axes, settings, message):
    with pytest.raises(lrf3d.InputError, match=message):
        lrf3d.sweep("city", axes=axes, **settings)


def test_means_have_the_interval_of_student():
    mean = mean_of([1.0, 2.0, 4.0, None])
    # Tables give t = 4.3027 for two degrees of freedom.
    assert mean["mean"] == pytest.approx(7.0 / 3.0) and mean["runs"] == 3
    half = 4.302653 * np.sqrt(7.0 / 3.0 / 3.0)
    assert mean["high"] - mean["mean"] == pytest.approx(half, rel=1e-6)
    assert mean_of([0.5]) == {"mean": 0.5, "low": None, "high": None, "runs": 1}
    assert mean_of([None])["mean"] is None


@pytest.mark.slow
def test_summary_figures_and_table_have_every_combination(room, tmp_path):
    result = run_plan(tiny(room), tmp_path, None)
    summary = json.loads(json.dumps(result.summary(), allow_nan=False))
    assert summary["runs"] == 24 and len(summary["combinations"]) == 8
    assert summary["combinations"][0]["length_f1"]["runs"] == 3
    for mean in result.means:
        settings = {name: mean[name] for name in ("mapper", "sigma_m", "beams")}
        mine = [row["length_f1"] for row in result.rows if settings.items() <= row.items()]
        assert len(mine) == 3 and mean["length_f1"]["mean"] == pytest.approx(np.mean(mine))
    figures = dict(figures_of(result).values())
    assert set(figures) == {"box_sigma.png", "box_beams.png"}
    drawn = {name: draw(tmp_path / name) for name, draw in figures.items()}
    panel = drawn["box_sigma.png"].axes[0]
    assert [line.get_xdata().tolist() for line in panel.lines] == 4 * [[0.0, 0.3]]
    assert len(str(result).splitlines()) == 1 + 8 + 2
    # A purity below that of chance is shown.
    low = [{**mean, "object_purity": dict.fromkeys(("mean", "low", "high"), -0.4)}
           for mean in result.means]  # fmt: skip
    figure = draw_sweep(low, column="sigma_m", choices=["beams"], axis="σ", titles=("", ""))
    assert figure.axes[2].get_ylim()[0] < -0.4


def test_the_command_writes_its_files_and_prints_one_value(room, tmp_path):
    command = ["sweep", room, "--sigma", "0.1", "--beams", "31", "--seeds", "2", "--workers", "1",
               "--out", str(tmp_path / "out"), "--json"]  # fmt: skip
    first = program(*command)
    assert json.loads(first.stdout)["runs"] == 4 and first.stderr == ""
    written = {path.name for path in Path(tmp_path / "out").iterdir() if path.name[0] != "."}
    assert written == {"sweep.jsonl", "runs.csv", "summary.json", "means.csv", "means.tex"}
    with (tmp_path / "out" / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["mapper"] for row in rows] == ["robust"] * 2 + ["paper"] * 2
    assert program(*command, "--resume").stdout == first.stdout
    shards = [word.replace("/out", "/jobs") for word in command]
    program(*shards, "--shard", "1/2")
    assert "2 runs are missing" in refused(*shards, "--merge")
    program(*shards, "--shard", "2/2")
    merged = json.loads(program(*shards, "--merge").stdout)
    assert merged["combinations"] == json.loads(first.stdout)["combinations"]
    assert "--vary mapper.gap: expected TABLE" in refused(*command, "--vary", "mapper.gap")


def test_an_own_mapper_is_named_by_its_file(room, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("swept.py").write_text(
        "import lrf3d\nclass Mine:\n    map = lrf3d.LineMap([[0, 0, 1, 0]], [0], [2])\n"
        "    def update(self, scan):\n        pass\n"
    )
    named = ("--mapper", "robust,swept.py:Mine", "--sigma", "0.1", "--seeds", "1")
    assert program("sweep", room, *named, "--workers", "1", "--out", "out").returncode == 0
    text = Path("out/means.csv").read_text()
    assert re.findall(r"^box,(\S+?),", text, re.M) == ["robust", "swept.py:Mine"]
