"""Each limit of the style can fail, and the package keeps all of them."""

import pytest

import style

SOUND = "def double(x):\n    return 2 * x\n"
LINE = "x = 1\n"
PACKED = "def f():\n    a, b = 1, 2\n"
BRANCHES = "def f(x):\n" + "    if x:\n        x -= 1\n" * 10
LOOPS = "".join("    " * k + "while x:\n" for k in range(1, 6))
NESTED = "def f(x):\n" + LOOPS + "    " * 6 + "x()"
ARGUMENTS = "def f(self, a, b, c, d, *, e, f, g, h): ...\n"
NAMES = "class Part: ...\nclass Part: ...\n"
CASES = {
    style.LINES: LINE * 501, style.PACKED: PACKED, style.BRANCHES: BRANCHES, style.NESTS: NESTED,
    style.ARGUMENTS: ARGUMENTS, style.NAMES: NAMES,
}  # fmt: skip


def found_in(folder, *texts):
    for number, text in enumerate(texts):
        (folder / f"part{number}.py").write_text(text)
    return style.findings(folder)


@pytest.mark.parametrize("limit", CASES)
def test_what_is_over_a_limit_is_found(limit, tmp_path):
    found = found_in(tmp_path, CASES[limit], SOUND)
    assert {each.limit for each in found} == {limit}
    assert str(found[0]).startswith(f"{tmp_path / 'part0.py'}:{found[0].line}: {found[0].name}: ")


def test_what_is_at_a_limit_is_not(tmp_path):
    fewer = [LINE * 500, BRANCHES.replace("    if x:\n        x -= 1\n", "", 1)]
    fewer += [ARGUMENTS.replace(", h", ""), ARGUMENTS.replace("def f(", "def __init__(")]
    fewer += [NESTED.replace("while x:\n" + "    " * 6, "")]
    # One packed assignment among forty.
    assert not found_in(tmp_path, *fewer, PACKED + 39 * LINE)


def test_constants_of_a_module_are_never_packed(tmp_path):
    [found] = found_in(tmp_path, "A, B = 1, 2\n" + 60 * LINE)
    assert found.limit == style.PACKED and found.line == 1


def test_as_many_exceptions_as_are_allowed_pass(tmp_path, monkeypatch):
    monkeypatch.setitem(style.ALLOWED, style.BRANCHES, 2)
    assert not style.too_many(found_in(tmp_path, BRANCHES, BRANCHES))
    assert len(style.too_many(found_in(tmp_path, BRANCHES, BRANCHES, BRANCHES))) == 3


def test_rooms_count_a_packed_assignment_by_its_targets(tmp_path):
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "a.py").write_text("a, b, c = 1, 2, 3\nd, e = f()\n")
    (tmp_path / "loose.py").write_text(LINE)
    rows = [line.split() for line in style.rooms(tmp_path).splitlines()]
    assert ["room", "4", "statements", "1", "files"] in rows
    assert ["all", "5", "statements", "2", "files"] in rows


def test_sizes_are_written_into_the_table_of_a_guide():
    guide = "| `casting/` | exact ranges | 2,896 |\n| loose files | names | 1 |\n| all | 3 |\n"
    table = "loose files    309 statements    5 files\ncasting      2,885 statements   20 files"
    changed = guide.replace("2,896", "2,885").replace("| 1 |", "| 309 |")
    assert style.with_sizes(guide, table) == changed
