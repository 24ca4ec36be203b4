"""Style: checks the limits that keep a function small and a name to one meaning.

    scripts/style            prints what is over a limit as FILE:LINE: NAME: WHAT; the status is 1
    scripts/style --rooms    prints the sizes of the rooms of the package in statements and files
    scripts/style --write    writes them into the table of CONTRIBUTING.md

A limit may allow a number of exceptions, which only ever falls. A packed assignment, `a, b = 1, 2`,
counts as many statements as it has targets, so that dense lines save nothing.
"""

import ast
import re
import sys
from argparse import ArgumentParser
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

MOST_BRANCHES = 10
MOST_NESTED = 4
MOST_ARGUMENTS = 7
MOST_LINES = 500

# Share of the assignments that may pack several values.
MOST_PACKED = 0.03

PACKED, BRANCHES, NESTS, ARGUMENTS, NAMES, LINES = (
    "packs values", "branches", "nested", "arguments", "names two things", "lines",
)  # fmt: skip

# How many functions may be over a limit; of all others none.
ALLOWED = {BRANCHES: 90, ARGUMENTS: 5}

BRANCHING = (ast.If, ast.For, ast.While, ast.ExceptHandler, ast.IfExp, ast.Assert,
             ast.comprehension, ast.match_case)  # fmt: skip
NESTING = (ast.If, ast.For, ast.While, ast.With, ast.Try)
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True, slots=True)
class Finding:
    """What is over a limit, and where."""

    limit: str
    path: Path
    line: int
    name: str
    what: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.name}: {self.what}"


def parsed(folder: Path) -> dict[Path, ast.Module]:
    """The modules of a folder, parsed."""
    files = sorted(folder.rglob("*.py"))
    return {file: ast.parse(file.read_text("utf-8")) for file in files}


def width(node: ast.AST) -> int:
    """The number of targets of a packed assignment; 1 of any other node."""
    if isinstance(node, ast.Assign) and isinstance(node.value, ast.Tuple):
        tuples = [target for target in node.targets if isinstance(target, ast.Tuple)]
        return max((len(target.elts) for target in tuples), default=1)
    return 1


def branches(function: Function) -> int:
    """The cyclomatic complexity of a function, with what it nests."""
    nodes = list(ast.walk(function))
    operands = sum(len(node.values) - 1 for node in nodes if isinstance(node, ast.BoolOp))
    return 1 + operands + sum(isinstance(node, BRANCHING) for node in nodes)


def depth(node: ast.AST) -> int:
    """The number of blocks inside each other."""
    inner = max(map(depth, ast.iter_child_nodes(node)), default=0)
    return inner + isinstance(node, NESTING)


def arguments(function: Function) -> int:
    """The number of arguments, without self and those of a star."""
    given = function.args
    bound = bool(given.args) and given.args[0].arg in ("self", "cls")
    return len(given.args) + len(given.kwonlyargs) - bound


def findings(folder: Path) -> list[Finding]:
    """All that is over a limit in the modules of a folder, also what is allowed."""
    trees = parsed(folder)
    nodes = [(path, node) for path, tree in trees.items() for node in ast.walk(tree)]
    found = [*_of_modules(trees), *_of_names(nodes)]
    for path, node in nodes:
        if isinstance(node, FUNCTIONS):
            found += _of_function(path, node)
    assigned = [(path, node) for path, node in nodes if isinstance(node, ast.Assign)]
    packed = [(path, node) for path, node in assigned if width(node) > 1]
    if len(packed) > MOST_PACKED * len(assigned):
        share = (
            f"of {len(assigned)} assignments {len(packed)} are packed: at most {MOST_PACKED:.0%}"
        )
        found += [Finding(PACKED, path, node.lineno, "assignment", share) for path, node in packed]
    return sorted(found, key=lambda each: (each.limit, each.path, each.line))


def _of_modules(trees: dict[Path, ast.Module]) -> Iterator[Finding]:
    for path, tree in trees.items():
        lines = path.read_text("utf-8").count("\n")
        if lines > MOST_LINES:
            yield Finding(LINES, path, 1, path.name, f"{lines} lines, at most {MOST_LINES}")
        for node in tree.body:
            if width(node) > 1:
                what = "a constant of a module needs its own line"
                yield Finding(PACKED, path, node.lineno, "constants", what)


def _of_names(nodes: list[tuple[Path, ast.AST]]) -> Iterator[Finding]:
    classes = [(path, node) for path, node in nodes if isinstance(node, ast.ClassDef)]
    homes = defaultdict(list)
    for path, node in classes:
        homes[node.name].append(f"{path}:{node.lineno}")
    for path, node in classes:
        others = [home for home in homes[node.name] if home != f"{path}:{node.lineno}"]
        if others:
            what = f"a class of this name is in {', '.join(others)}, too"
            yield Finding(NAMES, path, node.lineno, node.name, what)


def _of_function(path: Path, function: Function) -> Iterator[Finding]:
    # A constructor takes what its object holds.
    given = 0 if function.name == "__init__" else arguments(function)
    measured = {
        BRANCHES: (branches(function), MOST_BRANCHES),
        NESTS: (depth(function), MOST_NESTED),
        ARGUMENTS: (given, MOST_ARGUMENTS),
    }
    for limit, (value, most) in measured.items():
        if value > most:
            what = f"{limit}: {value}, at most {most}"
            yield Finding(limit, path, function.lineno, function.name, what)


def too_many(found: list[Finding]) -> list[Finding]:
    """Those findings of whose limit there are more than are allowed."""
    counts = Counter(each.limit for each in found)
    return [each for each in found if counts[each.limit] > ALLOWED.get(each.limit, 0)]


def rooms(package: Path) -> str:
    """The rooms of a package, a line each: statements, files."""
    sizes: Counter[str] = Counter()
    files: Counter[str] = Counter()
    for path, tree in parsed(package).items():
        parts = path.relative_to(package).parts
        room = parts[0] if len(parts) > 1 else "loose files"
        files[room] += 1
        sizes[room] += sum(width(node) for node in ast.walk(tree) if isinstance(node, ast.stmt))
    rows = [*sizes.most_common(), ("all", sizes.total())]
    files["all"] = files.total()
    return "\n".join(f"{room:12}{size:7,} statements{files[room]:5} files" for room, size in rows)


def with_sizes(text: str, table: str) -> str:
    """A text whose table of rooms has the sizes of another table, that of :func:`rooms`."""
    for row in table.splitlines():
        room, size = row.split(" statements")[0].rsplit(maxsplit=1)
        name = re.escape(room.strip())
        text = re.sub(rf"(?m)^(\| `?{name}/?`? \|.*\| )[\d,]+ \|$", rf"\g<1>{size} |", text)
    return text


def main() -> int:
    """Print what is over a limit, or the rooms."""
    parser = ArgumentParser(prog="scripts/style", description=__doc__.splitlines()[0])
    parser.add_argument("--rooms", action="store_true", help="Print the rooms and their sizes.")
    parser.add_argument("--write", action="store_true", help="Write them into CONTRIBUTING.md.")
    package = Path("lrf3d")
    asked = parser.parse_args()
    if asked.rooms or asked.write:
        table = rooms(package)
        print(table)
        if asked.write:
            guide = Path("CONTRIBUTING.md")
            guide.write_text(with_sizes(guide.read_text("utf-8"), table), "utf-8")
        return 0
    wrong = too_many(findings(package))
    for each in wrong:
        print(each)
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
