import sys

import pytest

from benchmarks.data_sheets import SHEETS, calibrated, farthest, main


@pytest.mark.parametrize("name", SHEETS)
def test_the_range_grows_with_the_root_of_the_reflectance(name):
    lrf = calibrated(SHEETS[name])
    nearest = SHEETS[name][0.1]
    assert farthest(0.1, lrf) == pytest.approx(nearest, abs=1e-6)
    assert farthest(0.4, lrf) == pytest.approx(2.0 * nearest, abs=1e-6)


def test_sheets_are_printed_and_drawn(tmp_path, monkeypatch, capsys):
    figure = tmp_path / "sheets.png"
    monkeypatch.setattr(sys, "argv", ["data_sheets", "--out", str(figure)])
    main()
    rows = capsys.readouterr().out.splitlines()[1:]
    assert len(rows) == sum(len(points) - 1 for points in SHEETS.values())
    assert float(rows[0].split()[-1]) == pytest.approx(0.98)
    assert figure.stat().st_size > 10_000
