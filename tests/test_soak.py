"""What a soak measures, and when it says that something grows."""

import os
import subprocess
import sys

import pytest

from stress.soak import COUNT_NOISE, MEMORY_NOISE, Part, growth, measured

pytestmark = pytest.mark.skipif(not os.path.exists("/proc/self/fd"), reason="reads /proc")


def part(**samples):
    return Part(None, samples={name.replace("_", " "): values for name, values in samples.items()})


def test_what_grows_beyond_noise_is_a_fault_and_what_was_loaded_first_is_not():
    loading = [100.0] * 5 + [300.0] * 15
    leaking = [100.0 + 2.0 * MEMORY_NOISE * step / 20 for step in range(20)]
    report, faults = growth({"a": part(memory=loading), "b": part(memory=leaking)})
    assert report["a"]["memory"] == (300.0, 300.0)
    assert len(faults) == 1 and faults[0].startswith("b: memory grew from")
    steady = [7.0] * 10 + [7.0 + COUNT_NOISE] * 10
    assert growth({"c": part(threads=steady)})[1] == []
    assert len(growth({"c": part(threads=[7.0] * 10 + [9.0 + COUNT_NOISE] * 10)})[1]) == 1


def test_files_of_work_under_way_are_no_leak_and_those_that_stay_are():
    idle, busy = [3.0] * 4 + [9.0] * 1, [3.0] * 1 + [9.0] * 4
    assert growth({"sweeps": part(temporary_files=2 * idle + 2 * busy)})[1] == []
    left = [value + 3.0 for value in busy]
    [fault] = growth({"sweeps": part(temporary_files=2 * idle + 2 * left)})[1]
    assert fault == "sweeps: temporary files grew from 3 to 6"


def test_a_program_that_ends_by_itself_is_a_fault():
    ended = part(threads=[1.0])
    ended.ended = "out of memory"
    assert growth({"run": ended})[1] == ["run: ended by itself: out of memory"]


def test_a_process_is_measured_from_the_outside():
    values = measured(os.getpid())
    assert values["memory [MB]"] > 10.0
    assert values["threads"] >= 1 and values["descriptors"] >= 3
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        process.wait()
    assert measured(process.pid) == {}
