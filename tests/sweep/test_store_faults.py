"""Faults at every call of the store of a sweep: what was flushed is kept, the rest made again."""

import shutil

import pytest

pytest.importorskip("resource", reason="Windows has no limits of a process")
pytest.importorskip("pyarrow", reason="needs pip install 'lrf3d[sweep]'")

from faults import FAULTS, MANY, Calls, contents, spread, still_open

from lrf3d.errors import OutputError
from lrf3d.sweep.grid import SweepGrid
from lrf3d.sweep.plan import make_plan
from lrf3d.sweep.store import TABLE, Store
from lrf3d.sweep.task import carry_out, unpack
from tests.sweep.test_sweep import ROOM

# A fault within a destructor, as that of a writer, cannot be raised: Python only warns of it.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


def store_with_faults(fault, folder, most):
    """Write the rows of a sweep with a fault at each call, and go on with it."""
    (folder / "room.toml").write_text(ROOM)
    axes = {"laser.beams": (31,), "noise.sigma": (0.1,)}
    plan = make_plan(SweepGrid.usual(str(folder / "room.toml"), axes=axes, seeds=2))
    rows = {}
    for run in plan.runs:
        place = unpack(plan.places[plan.cells[run.cell].place].packed())
        rows[run.order.key] = carry_out(place, [run.order]).rows
    place = folder / "place"

    def write(*, resume):
        with Store(place, plan, resume=resume) as store:
            begun = len(store)
            for key, row in rows.items():
                if key not in store:
                    store.add(row)
                    store.flush()
                    flushed.add(key)
            store.finish()
        return begun

    counts, made, expected = FAULTS[fault]
    flushed = set()
    with Calls(counts) as calls:
        write(resume=False)
    whole = contents(place)
    assert list(whole) == [TABLE]
    numbers = spread(calls.made, most)
    for number in numbers:
        shutil.rmtree(place)
        error, flushed = None, set()
        try:
            with Calls(counts, number, made) as calls:
                write(resume=False)
        except BaseException as caught:
            error, text = type(caught), str(caught)
        left = contents(place) if place.exists() else {}
        finished = left.get(TABLE) == whole[TABLE]
        # Interrupted as it closes a folder, shutil closes it once more, which is an error.
        known = error == expected or (error is OSError and "shutil.py" in calls.place)
        assert known or (error is None and finished), (calls.place, error)
        # Parts that could not be removed and a lock that was never held are no harm.
        assert all(name.endswith((".parquet", ".lock", "parts")) for name in left), calls.place
        if expected is OutputError and error:
            assert "\n" not in text and str(place) in text
        assert still_open(folder) == [], calls.place
        # What was flushed is there, and is not made again.
        kept = len(flushed)
        assert write(resume=True) >= kept, calls.place
        assert contents(place) == whole, calls.place
    return len(numbers)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_store_that_fails_at_any_call_keeps_what_was_flushed(fault, tmp_path):
    assert store_with_faults(fault, tmp_path, 60) > 10


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_store_that_fails_at_many_calls_keeps_what_was_flushed(fault, tmp_path):
    assert store_with_faults(fault, tmp_path, MANY) > 10
