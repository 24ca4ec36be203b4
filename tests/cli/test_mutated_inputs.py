"""Mutated inputs of every kind end in a result or in one clear line, in bounded time and memory.

``LRF3D_MUTATED=2000`` tries two thousand instead of a hundred; as a program, this file tries those
of some seeds and prints what is wrong: ``python tests/cli/test_mutated_inputs.py FIRST LAST``.
"""

import os
import sys
import tempfile
from pathlib import Path

import pytest
from mutated_inputs import Inputs, end

COUNT = int(os.environ.get("LRF3D_MUTATED", "100"))
FEW = 6
"""Those that are tried also where slow tests are left out."""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    return Inputs(tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize(
    "seed",
    [pytest.param(n, marks=[pytest.mark.slow] if n >= FEW else []) for n in range(COUNT)],
)
def test_a_mutated_input_ends_well(seed, inputs, tmp_path):
    case = inputs.mutated(seed)
    fault = end(case, tmp_path).fault()
    assert not fault, f"{case.name}, {' '.join(case.command)[:500]}: {fault}"


def main(first: int, last: int) -> None:
    """Try the inputs of some seeds."""
    wrong, slowest, largest, ends = 0, 0.0, 0, {0: 0, 1: 0, 2: 0}
    with tempfile.TemporaryDirectory() as whole:
        inputs = Inputs(Path(whole))
    for seed in range(first, last):
        case = inputs.mutated(seed)
        with tempfile.TemporaryDirectory() as folder:
            ended = end(case, Path(folder))
        slowest, largest = max(slowest, ended.seconds), max(largest, ended.bytes)
        ends[ended.status] = ends.get(ended.status, 0) + 1
        if fault := ended.fault():
            wrong += 1
            print(f"=== {seed} {case.name} {' '.join(case.command)[:300]!r}: {fault}", flush=True)
    print(
        f"{wrong} of {last - first} ended badly; status {ends}, at most {slowest:.1f} s of a"
        f" processor and {largest / 2**20:.0f} MiB"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
