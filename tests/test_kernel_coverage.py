"""What is measured of compiled kernels is what coverage.py measures of them as Python code."""

import ast
import os
import subprocess
import sys

import pytest

pytest.importorskip("coverage", reason="needs pip install 'lrf3d[dev]'")

from coverage import CoverageData
from coverage.parser import PythonParser
from kernel_coverage import LINES, kernels, marked, reached_arcs

KERNELS = '''"""Kernels of all forms that a block can have."""


def compiled(function):
    return function


inner = compiled


@compiled
def search(values, wanted):
    """The place of a value, or −1.

    A docstring is no statement.
    """
    for k in range(len(values)):
        if values[k] == wanted:
            found = k
            break
    else:
        return -1
    if found > 1:
        found += 0
    return found


@inner
def steps(number, most):
    count = 0
    while number != 1:
        if number % 2:
            number = 3 * number + 1
        elif (
            number > 0
            and number > 1
        ):
            number //= 2
        else:
            break
        count += 1
        if count < most:
            continue
        count = -1
        break
    return count


@compiled
def unused(x):
    for _ in range(3):
        x += 1
    return x


@inner
def first_even(values):
    for value in values:
        if not value % 2:
            return value
    while True:
        return -1
'''

CALLS = [
    "",
    "search([1, 2, 3], 1)",
    "search([1, 2, 3], 3)",
    "search([], 3)",
    "search([4], 3); search([3], 3)",
    "steps(1, 9)",
    "steps(6, 99)",
    "steps(6, 2); steps(-4, 9)",
    "first_even([1, 2])",
    "first_even([1])",
    "first_even([]); search([1, 3], 3); steps(8, 9)",
]


def marks_of(calls):
    """The marks that some calls leave, with kernels that run as Python code."""
    marks = bytearray(2 * LINES)

    def mark(place):
        marks[place] = 1

    tree = marked(ast.parse(KERNELS), 0)
    tree.body = [node for node in tree.body if not isinstance(node, ast.ImportFrom)]
    names = {"_mark_of_coverage": mark}
    exec(compile(tree, "marked", "exec"), names)
    exec(calls, names)
    return bytes(marks)


@pytest.mark.parametrize("calls", CALLS)
def test_marks_show_the_arcs_that_coverage_traces(calls, tmp_path):
    path = tmp_path / "kernels.py"
    path.write_text(KERNELS)
    (tmp_path / "main.py").write_text(f"from kernels import *\n{calls}\n")
    # Neither the settings nor the data of a run that is being measured.
    clean = {name: text for name, text in os.environ.items() if not name.startswith("COVERAGE")}
    words = ["run", "--branch", "main.py"]
    subprocess.run([sys.executable, "-m", "coverage", *words], cwd=tmp_path, env=clean, check=True)
    data = CoverageData(str(tmp_path / ".coverage"))
    data.read()
    parser = PythonParser(text=KERNELS)
    parser.parse_source()
    # Definitions are executed as Python code, and only lines of kernels have marks.
    inside = {line for kernel in kernels(ast.parse(KERNELS)) for line in lines_of(kernel)}
    traced = {arc for arc in parser.translate_arcs(data.arcs(str(path))) if max(arc) in inside}
    assert set(reached_arcs(path, marks_of(calls))) == traced & set(parser.arcs())


def lines_of(kernel):
    """The lines of the statements of a kernel."""
    return range(kernel.body[0].lineno, kernel.end_lineno + 1)
