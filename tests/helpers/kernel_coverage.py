"""Coverage of compiled kernels: each block of a kernel notes that it was reached.

Coverage.py sees what Python executes, not what numba has compiled. As a plugin of coverage.py this
module is loaded in each process that is measured. There it puts a mark at the start of each block
of the kernels that are imported: one byte is written, at an address that is the same in all
processes, and these bytes are a file. So kernels are measured at nearly their full speed, in the
workers of films and sweeps too. `python -m kernel_coverage` adds what was reached to the data of
coverage.py. Linux only.
"""

import ast
import ctypes
import os
import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import PathFinder, SourceFileLoader
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

MARKS = ROOT / "build" / "coverage.marks"
"""The file of the marks; kernels are measured if it is there."""

ADDRESS = 0x2000_0000_0000
"""Where the file is mapped: far from where Linux puts libraries, the heap and stacks."""

LINES = 512
"""Lines of a file that there is room for. Each has two marks: the block that starts in it was
reached, and its condition failed, or its loop ended, where no block follows."""

DECORATORS = {"borrower", "compiled", "inner"}

BRANCHES = (ast.If, ast.For, ast.While)


def files():
    """The files of the package that may have kernels, in an order that is always the same."""
    return sorted((ROOT / "lrf3d").rglob("*.py"))


def kernels(tree):
    """The kernels of a module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            if any(isinstance(by, ast.Name) and by.id in DECORATORS for by in node.decorator_list):
                yield node


def blocks(body):
    """The blocks of a body: statements that are all reached if the first one is."""
    block = []
    for statement in body:
        block.append(statement)
        if isinstance(statement, BRANCHES):
            yield block
            yield from blocks(statement.body)
            yield from blocks(statement.orelse)
            block = []
    if block:
        yield block


def body_of(kernel):
    """The statements of a kernel without its docstring."""
    return kernel.body[ast.get_docstring(kernel) is not None :]


def marked(tree, base):
    """Put a mark at the start of each block of all kernels, and where a condition fails."""

    def call(place, at):
        name = ast.Name("_mark_of_coverage", ast.Load())
        node = ast.Expr(ast.Call(name, [ast.Constant(base + place)], []))
        return ast.fix_missing_locations(ast.copy_location(node, at))

    def with_marks(body):
        found = []
        first = True
        for statement in body:
            if first:
                found.append(call(2 * statement.lineno, statement))
            found.append(statement)
            first = isinstance(statement, BRANCHES)
            if first:
                statement.body = with_marks(statement.body)
                missed = [call(2 * statement.lineno + 1, statement)]
                statement.orelse = with_marks(statement.orelse) or missed
        return found

    for kernel in list(kernels(tree)):
        kernel.body = with_marks(body_of(kernel))
    names = [ast.alias("mark", "_mark_of_coverage")]
    after = ast.get_docstring(tree) is not None
    tree.body.insert(after, ast.ImportFrom("kernel_mark", names, 0, lineno=1, col_offset=0))
    return ast.fix_missing_locations(tree)


class MarkedLoader(SourceFileLoader):
    """Loads a module with its marks."""

    def get_code(self, fullname):
        """The code, which is never that of a file of bytecode."""
        tree = ast.parse(self.get_data(self.path))
        place = files().index(Path(self.path).resolve())
        return compile(marked(tree, place * 2 * LINES), self.path, "exec")


class MarkedFinder(MetaPathFinder):
    """Finds the modules of the package that have kernels."""

    def find_spec(self, fullname, path, target=None):
        """The specification of such a module; None for others."""
        if not fullname.startswith("lrf3d."):
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is None or spec.origin is None or not Path(spec.origin).is_relative_to(ROOT):
            return None
        if not any(kernels(ast.parse(Path(spec.origin).read_bytes()))):
            return None
        spec.loader = MarkedLoader(fullname, spec.origin)
        return spec


def map_marks():
    """Map the file of the marks to its address."""
    size = len(files()) * 2 * LINES
    number = os.open(MARKS, os.O_RDWR)
    os.ftruncate(number, size)
    libc = ctypes.CDLL(None, use_errno=True)
    libc.mmap.restype = ctypes.c_void_p
    libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
    read_and_write, shared, fixed = 3, 1, 0x100000
    got = libc.mmap(ADDRESS, size, read_and_write, shared | fixed, number, 0)
    os.close(number)
    if got != ADDRESS:
        raise OSError(ctypes.get_errno(), "the marks cannot be mapped")


def coverage_init(registry, options):
    """Called by coverage.py in each process that it measures."""
    if MARKS.exists() and not any(isinstance(each, MarkedFinder) for each in sys.meta_path):
        map_marks()
        sys.meta_path.insert(0, MarkedFinder())


def reached_arcs(path, marks):
    """The arcs between lines of a file's kernels that were taken, as coverage.py counts them."""
    from coverage.parser import PythonParser

    text = path.read_text()
    parser = PythonParser(text=text)
    parser.parse_source()
    reached, missed, ahead = set(), set(), {}
    spans = []
    for kernel in kernels(ast.parse(text)):
        spans.append((kernel.body[0].lineno, kernel.end_lineno, -kernel.lineno))
        for block in blocks(body_of(kernel)):
            if marks[2 * block[0].lineno]:
                reached |= {statement.lineno for statement in block}
            for statement in block:
                if isinstance(statement, BRANCHES):
                    ahead[statement.lineno] = statement.body[0].lineno
                    failed = statement.orelse[0].lineno if statement.orelse else None
                    if marks[2 * (failed or statement.lineno) + (failed is None)]:
                        missed.add(statement.lineno)

    def taken(start, end):
        if start in ahead:
            return end in reached if end == ahead[start] else start in missed
        return (start < 0 or start in reached) and (end < 0 or end in reached)

    for start, end in parser.arcs():
        inside = max(start, end)
        if any(first <= inside <= last for first, last, _ in spans) and taken(start, end):
            yield start, end


def main():
    """Write what was reached to a file that `coverage combine` takes."""
    from coverage import CoverageData

    found = {}
    content = MARKS.read_bytes()
    for number, path in enumerate(files()):
        marks = content[number * 2 * LINES :][: 2 * LINES]
        if any(marks):
            found[str(path)] = list(reached_arcs(path, marks))
    data = CoverageData(str(ROOT / ".coverage"), suffix="kernels")
    data.add_arcs(found)
    data.write()


if __name__ == "__main__":
    main()
