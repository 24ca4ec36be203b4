"""What ``scripts/bench slam`` prints is the error of one drive at each key spacing."""

import json

import pytest
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.slam import Drive, bench_slam, chart
from lrf3d.errors import InputError
from lrf3d.exporting import export_run
from lrf3d.scenario_file import load_scenario


@pytest.fixture(scope="module")
def result():
    return bench_slam(Drive.simulated(120), [0.5, 1.0])


def test_each_spacing_has_its_error_and_its_time(result):
    rows = result.as_dict()["entries"]
    assert [row["spacing"] for row in rows] == ["0.5 m", "1 m"]
    assert max(row["error_m"] for row in rows) < 0.05
    assert [row["default"] for row in rows] == [True, False]
    assert chart(result).axes


def test_a_log_is_scored_by_its_relations(tmp_path):
    log, relations = tmp_path / "drive.log", tmp_path / "drive.relations"
    run = load_scenario("corridor").run(rng=0, scans=60)
    export_run(run, "carmen", log)
    relations.write_text("0 40 9.0 9.0 0.0\n")
    arguments = ["slam", "--log", log, "--relations", relations, "--spacings", "0.5", "--json"]
    done = CliRunner().invoke(app, list(map(str, arguments)))
    assert done.exit_code == 0
    rows = json.loads(done.output)["entries"]
    assert all(row["log"] == "drive" and row["error_m"] > 1.0 for row in rows)


@pytest.mark.parametrize(
    "arguments", [("--log", "a.log"), ("--spacings", "a"), ("--spacings", "0.5,0")]
)
def test_what_is_asked_for_wrongly_is_refused(arguments):
    done = CliRunner().invoke(app, ["slam", *arguments])
    assert done.exit_code == 1 and isinstance(done.exception, InputError)
