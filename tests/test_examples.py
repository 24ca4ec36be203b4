"""The examples in the docstrings of public names: each name has one, and does what it shows."""

import doctest
import warnings

import pytest

import lrf3d


@pytest.mark.parametrize(
    "name",
    # A film takes its time; of errors only the root has an example.
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name == "render_video"))
        for name in lrf3d.__all__
        if name == "Lrf3dError" or not name.endswith("Error")
    ],
)
def test_a_public_name_has_an_example_that_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    value = getattr(lrf3d, name)
    [test] = doctest.DocTestFinder(recurse=False).find(value, name, module=False)
    assert test.examples
    report = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        failed, _ = doctest.DocTestRunner(verbose=False).run(test, out=report.append)
    assert not failed, "".join(report)
