"""Guesses: the ways to find what the columns of a text hold, if no format says so.

The form of a text enters `layout_of`; the first guess of `GUESSES` that fits gives its layout. If
none fits, the error shows a format that reads it: nothing is read silently in a wrong way.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lrf3d.base.errors import InputError, one_line
from lrf3d.geometry.lines import ROUNDING, Float
from lrf3d.recordings.formats.table import CUT, WHOLE, meaning
from lrf3d.recordings.formats.text.dialects import Words
from lrf3d.recordings.formats.text.fans import FANS, LEAST_ALIKE
from lrf3d.recordings.formats.text.layout import Form, Layout, described
from lrf3d.recordings.formats.text.lines import SHORT, VARIED, is_number, rises, values_of
from lrf3d.recordings.log import Intake

# Matches one of a series of columns: its name, its number, and a unit.
SERIES = re.compile(
    r"(.*?)[\s\[(;._]*(?<!\d)(?<!\d\.)(-?\d+(?:\.\d+)?)[\s\])°]*"
    r"(?:[_/ ]*(?:deg|(mm|cm|m|ft|feet|inch|inches)))?"
).fullmatch

# Largest number of words before the number of ranges.
MOST_BEFORE_COUNT = 8

# Fewest words after a number for which it may be their count.
FEWEST_COUNTED = 9

# The columns of `ros2 topic echo --csv` of a LaserScan.
ECHOED = {"stamp": 0, "nanosec": 1, "first": 3, "last": 4, "step": 5, "ranges": 10}

# A turn in the units that bearings may have, rad and degrees.
TURNS = (2.0 * np.pi, 360.0)

# Least width of bearings that go round, in turns.
LEAST_SWEEP = 0.3

# Their largest width, in turns: a turn and what rounding adds.
LARGEST_SWEEP = 1.01

# The bearings of a sweep jump back at less than this share of its readings.
MOST_JUMPS = 0.1

# Largest step of bearings in a scan of pairs, in usual steps: beams without return may be left out.
UNEVEN = 30.0

# The columns before such pairs in files without a header, by their number.
LEADING = {1: "stamp", 3: "x y theta", 4: "stamp x y theta"}

# Number of columns at the start of the ranges that may be stamps or encoder counts.
FIRST_COLUMNS = 40

# Largest factor between the usual readings of neighbouring beams.
ALIKE = 2.0

# Least factor between numbers that only rise and ranges, from which they are not beams.
OTHER_SCALE = 5.0

# Largest quality of a reading, which is a byte.
LARGEST_QUALITY = 255

# Largest heading [°] in a line without names: two turns.
LARGEST_HEADING = 2.0 * TURNS[1]


@dataclass(frozen=True, slots=True)
class Guess:
    """A way to find the columns of scans.

    Args:
        name: What the columns are found by, as notes say it.
        what: How they are found, in a sentence.
        find: Returns the layout of a form; None if the guess does not fit.
    """

    name: str
    what: str
    find: Callable[[Form], Layout | None]


def layout_of(form: Form, intake: Intake) -> Layout:
    """The layout of the first guess that fits; a note says which columns were found, and how.

    Raises:
        InputError: No guess fits.
    """
    guesses = ((guess.name, guess.find(form)) for guess in GUESSES)
    name, layout = next((found for found in guesses if found[1]), ("", None))
    if layout is None:
        raise InputError(f"{intake.path}: {_refusal(form)}")
    kind = f"a line of at least {form.least} words" if form.least else ""
    if kind := f"a line that begins with {form.word}" if form.word else kind:
        intake.notes.append(f"a scan is {kind}: all others are left out")
    columns = ", ".join(f"{role} {column + 1}" for role, column in layout.columns.items())
    if layout.unused:
        columns += f"; not used: {one_line(', '.join(layout.unused), 100)}"
    intake.notes.append(f"columns found by {name}: {columns}; --format says otherwise")
    return layout


def _refusal(form: Form) -> str:
    """Why nothing was found."""
    if _holds_poses(form):
        return f"columns of {', '.join(by_names(form).columns)}, none of ranges; is it odometry?"
    places = [k + 1 for k in range(min(form.length, SHORT)) if rises(form.sample, k)]
    rising = f", number {', '.join(map(str, places))} rising as stamps do" if places else ""
    return f"text of {form.length} columns{rising}; name them by --format"


def _holds_poses(form: Form) -> bool:
    """Whether the names in a header are those of poses, and none is that of ranges."""
    named_by = by_names(form).columns.keys()
    return bool({"x", "dx", "left"} & named_by) and "ranges" not in named_by


def formats_for(form: Form) -> list[str]:
    """Formats that may read a text in which nothing was found."""
    specs = list[str]()
    if form.length <= SHORT and not _holds_poses(form):
        columns = form.table.T
        fits = [k for k in range(min(form.length, 2)) if swept(columns[k]) > LEAST_SWEEP]
        # Ranges have no sign, coordinates have.
        specs = [f"angles@{k + 1}, ranges@{2 - k}" for k in fits if not (columns[1 - k] < 0).any()]
    elif form.length > SHORT and form.is_steady:
        specs = [_wide_format(form)]
    return [
        spec.replace("ranges", f"ranges{unit}") for spec in specs for unit in ("", ":mm") if spec
    ]


def _wide_format(form: Form) -> str:
    """A format of a scan a line at usual bearings; "" if none fit, or the numbers are no ranges."""
    rows = form.table
    stamped = rises(form.sample, 0)
    # Words after the numbers are labels.
    end = int(np.flatnonzero(np.isfinite(rows).any(axis=0)).max(initial=-1)) + 1
    # A scan does not begin with a column of zeros.
    begins = range(int(stamped), min(end, FIRST_COLUMNS))
    usual = [k for k in begins if end - k in FANS and rows[:, k].any()]
    if not usual or any(map(SERIES, form.header)):
        return ""
    begin = usual[0]
    ranges = rows[:, begin:end]
    beams = f"*{end - begin}" * (end < form.length)
    # What is of the same size before the first column is a part of the scan, too.
    sizes = np.median(np.abs(rows[:, max(begin - 2, int(stamped)) : begin + 1]), axis=0)
    before = sizes[:-1]
    goes_on = ((ALIKE * before > sizes[-1]) & (before < ALIKE * sizes[-1])).any()
    likely = not (has_several_negative(ranges) or goes_on or _counts_up(form, begin))
    stamp = "stamp@1, " if stamped else ""
    return f"{stamp}ranges{beams}@{begin + 1}" if likely else ""


def by_names(form: Form) -> Layout:
    """The columns that the names in a header give; there may be no ranges among them."""
    layout = Layout()
    series = dict[str, list[int]]()
    for place, name in enumerate(form.header):
        role, unit = meaning(name)
        if numbered := SERIES(name):
            base = "_".join(filter(None, numbered.group(1, 3)))
            series.setdefault(base, []).append(place)
        # "Scan" next to a column of distances numbers the scans.
        elif role and (role not in layout.columns or _numbers(form, layout.columns[role])):
            layout.name(role, place, unit)
    known = {base: places for base, places in series.items() if meaning(base)[0] == "ranges"}
    base, places = max((known or series).items(), key=lambda one: len(one[1]), default=("", []))
    if len(places) > 1 and places == list(range(places[0], places[-1] + 1)):
        _take_fan(layout, base, form.header[places[0] : places[-1] + 1], places[0])
    elif "ranges" in layout.columns:
        _take_one_name(layout, form)
    return layout


def _numbers(form: Form, place: int) -> bool:
    """Whether a column numbers the scans: it is named so, and holds whole numbers that rise."""
    *above, last = re.split("[^a-z]+", form.header[place])
    numbers = values_of(words[place] for words in form.sample if place < len(words))
    counted = not (numbers % 1.0).any() and (np.diff(numbers) >= 0.0).all()
    return last == "scan" and (not above or bool(counted))


def _take_fan(layout: Layout, base: str, names: Words, begin: int) -> None:
    """Enter a series of columns of ranges, whose names may end with their bearings."""
    role, unit = meaning(base)
    layout.name("ranges", begin, unit if role == "ranges" else "")
    layout.beams = len(names)
    bearings = np.array([float(found[2]) for found in map(SERIES, names) if found])
    wide = np.ptp(bearings)
    # Names that count from 0 or 1 are the numbers of the beams, not their bearings.
    counts = bearings.min() in (0.0, 1.0) and wide == len(bearings) - 1
    if counts and role == "ranges" and (np.diff(bearings) != 1.0).any():
        raise InputError(f"columns {names[0]} to {names[-1]}: not in the order of their numbers")
    if not counts and wide <= TURNS[1]:
        layout.bearings = bearings
    # A single angle next to a whole scan is the heading of the robot.
    if "angles" in layout.columns:
        turn = layout.columns.pop("angles")
        unit = layout.units.pop("angles", "")
        layout.name("theta", layout.columns.get("theta", turn), unit)


def _take_one_name(layout: Layout, form: Form) -> None:
    """Enter ranges under one name: those of a whole scan, or a single one with its bearing."""
    at = layout.columns["ranges"]
    extra = form.length - len(form.header)
    if extra > 0:
        intense = form.header[at + 1 : at + 2] == ["intensities"]
        layout.beams = (extra // 2 if intense else extra) + 1
        layout.columns = {k: v + extra * (v > at) for k, v in layout.columns.items()}
        return
    if "x" not in layout.columns and "theta" in layout.columns:
        layout.columns.setdefault("angles", layout.columns.pop("theta"))
    layout.beams = 1


def _by_header(form: Form) -> Layout | None:
    layout = by_names(form)
    if layout.beams is None or (layout.beams == 1 and "angles" not in layout.columns):
        return None
    layout.length = form.length if form.is_steady else None
    if len(form.header) == form.length:
        begin = layout.columns["ranges"]
        used = {*layout.columns.values(), *range(begin, begin + layout.beams)}
        layout.unused = [name for k, name in enumerate(form.header) if name and k not in used]
    return layout


def _by_count(form: Form) -> Layout | None:
    sample = form.sample
    for place in range(min(MOST_BEFORE_COUNT, min(map(len, sample)) - 1)):
        if all(_counts(words, place) for words in sample):
            rising = [k for k in range(place) if rises(sample, k)]
            stamp = {"stamp": rising[0]} if rising else {}
            return Layout({"ranges": place + 1} | stamp | _fan_before(sample[0], place))
    return None


def _counts(words: Words, place: int) -> bool:
    """Whether a word is the number of those after it."""
    rest = len(words) - place - 1
    return rest >= FEWEST_COUNTED and is_number(words[place]) and float(words[place]) == rest


def _fan_before(words: Words, count: int) -> dict[str, int]:
    """The columns of the first bearing, the last one and the step, before the number of ranges."""
    for place in range(count - 2):
        for names in (("first", "step", "last"), ("first", "last", "step")):
            columns = {name: place + k for k, name in enumerate(names)}
            first, last, step = values_of(
                words[columns[name]] for name in ("first", "last", "step")
            )
            end = first + step * (len(words) - count - 2)
            # The step is below 0.1 rad.
            if abs(end - last) < 2.0 * abs(step) < 0.2:
                return columns
    return {}


def _by_echo(form: Form) -> Layout | None:
    for words in form.sample:
        if len(words) < 12 or is_number(words[2]) or not all(map(is_number, words[3:10])):
            return None
        if CUT in words:
            raise InputError(WHOLE)
    first, last, step = map(float, form.sample[0][3:6])
    said = round((last - first) / step) + 1 if step else 0
    values = form.length - ECHOED["ranges"]
    # Drivers send a beam more or fewer than they say, and an intensity for each or none.
    beams = next((n for n in (values, values // 2) if abs(n - said) <= 1), 0)
    return Layout(dict(ECHOED), beams, form.length if form.is_steady else None) if beams else None


def _by_sweep(form: Form) -> Layout | None:
    if not form.is_steady or not 2 <= form.length <= SHORT:
        return None
    columns = [*form.table.T]
    varied = [k for k, column in enumerate(columns) if len({*column.tolist()}) > VARIED]
    for place in _bearings_among(columns):
        if others := [k for k in varied if k != place]:
            found = _sweep(columns, place, others)
            return Layout(found, 1, form.length, unused=_further(columns, found))
    return None


def _further(columns: Sequence[Float], found: dict[str, int]) -> Words:
    """The numbers of columns that vary and are not used."""
    used = found.values()
    return [f"number {k + 1}" for k, each in enumerate(columns) if k not in used and np.ptp(each)]


def _bearings_among(columns: Sequence[Float]) -> list[int]:
    """The columns that may be bearings; a file of two columns may be a single scan."""
    if len(columns) == 2 and swept(columns[0]) > LEAST_SWEEP * TURNS[0]:
        return [0]
    return [k for k, column in enumerate(columns) if _goes_round(column)]


def _goes_round(bearings: Float) -> bool:
    """Whether numbers rise or fall, and jump back about a turn now and then."""
    wide = np.ptp(bearings)
    steps = np.diff(bearings)
    back = np.abs(steps) > 0.5 * wide
    turn = next((turn for turn in TURNS if wide <= LARGEST_SWEEP * turn), np.inf)
    if not (wide > LEAST_SWEEP * turn and 1 <= back.sum() < MOST_JUMPS * len(steps)):
        return False
    return bool(max((steps[~back] > 0.0).mean(), (steps[~back] < 0.0).mean()) >= LEAST_ALIKE)


def _sweep(columns: Sequence[Float], place: int, others: Sequence[int]) -> dict[str, int]:
    """The columns of a sweep: ranges are next to the bearings, rather after them, stamps first."""
    after = min(others, key=lambda k: (abs(k - place), k < place))
    found = {"angles": place, "ranges": after}
    if 0 in others and after != 0 and (np.diff(columns[0]) >= 0.0).all():
        found["stamp"] = 0
    left = [k for k in range(len(columns)) if k not in found.values() and columns[k].max() > 1.0]
    # Qualities do not rise like stamps, or like the angle to which a scanner is tilted.
    left = [k for k in left if columns[k][0] >= columns[k][-1] or (np.diff(columns[k]) < 0.0).any()]
    if left and columns[left[-1]].max() <= LARGEST_QUALITY:
        found["quality"] = left[-1]
    return found


def _by_pairs(form: Form) -> Layout | None:
    rows = [values_of(words) for words in form.sample if len(words) > 2 * FEWEST_COUNTED]
    for place in range(MOST_BEFORE_COUNT if 2 * len(rows) > len(form.sample) else 0):
        ways = (way for way in (1, -1) if all(_are_pairs(row[place:][::way]) for row in rows))
        if way := next(ways, 0):
            roles = [meaning(name) for name in form.header[:place]]
            roles = roles or [(name, "") for name in LEADING.get(place, "").split()]
            layout = Layout(paired=way)
            for k, (role, unit) in enumerate(roles):
                if role:
                    layout.name(role, k, unit)
            layout.name("ranges", place)
            return layout
    return None


def _are_pairs(row: Float) -> bool:
    """Whether every other number is a bearing of one scan."""
    return len(row) % 2 == 0 and len(row) >= 2 * FEWEST_COUNTED and swept(row[::2]) > LEAST_SWEEP


def swept(bearings: Float) -> float:
    """How far numbers go as the bearings of one scan: one way, in even steps, a turn at most.

    This is 0 for others; bearings may begin anew within the scan, as at 0°.
    """
    wide = np.ptp(bearings)
    turn = next((turn for turn in TURNS if wide <= LARGEST_SWEEP * turn), None)
    if turn is None or len(bearings) < 2:
        return 0.0
    steps = (np.diff(bearings) + 0.5 * turn) % turn - 0.5 * turn
    whole = float(np.abs(steps).sum())
    one_way = bool((steps > 0.0).all() or (steps < 0.0).all())
    even = np.abs(steps).max() < UNEVEN * np.median(np.abs(steps))
    return whole if one_way and even and whole <= LARGEST_SWEEP * turn else 0.0


def _by_length(form: Form) -> Layout | None:
    stamp = ["stamp"] if rises(form.sample, 0) else []
    for names in (stamp, [*stamp, "x", "y", "theta"]):
        place = len(names)
        if form.has_numbers and form.length - place in FANS and not _counts_up(form, place):
            if names == stamp or (np.abs(form.table[:, place - 1]) <= LARGEST_HEADING).all():
                return _in_order(form, stamp, names != stamp)
    return None


def _in_order(form: Form, stamp: Words, placed: bool) -> Layout:
    """The layout of a stamp and ranges, with a pose before or after these if they are placed."""
    pose = ["x", "y", "theta"] * placed
    columns = [*stamp, *pose, "ranges"]
    if placed and _poses_are_last(form, len(stamp)):
        beams = form.length - len(stamp) - len(pose)
        columns = [*stamp, f"ranges*{beams}", *pose]
    return replace(described(", ".join(columns), []), length=form.length)


def _poses_are_last(form: Form, begin: int) -> bool:
    """Whether the last three columns have many negative numbers, which the first three have not."""
    first = form.table[:, begin : begin + 3]
    return has_several_negative(form.table[:, -3:]) and not has_several_negative(first)


def has_several_negative(ranges: Float) -> bool:
    """Whether ranges have several negative values: beams without return have one."""
    return len({*ranges[ranges < 0.0].tolist()}) > 1


def _counts_up(form: Form, place: int) -> bool:
    """Whether one of the first columns never falls, like stamps and encoders but unlike ranges.

    Such columns would be taken for the first beams.
    """
    table = form.table[:, place : place + FIRST_COLUMNS]
    # Missing readings become 0, so that a column with some of them also falls.
    table = np.where(np.isfinite(table), table, 0.0)
    steps = np.diff(table, axis=0)
    rising = (steps >= 0.0).all(axis=0) & (steps > 0.0).any(axis=0)
    usual = np.median(table)
    apart = np.abs(np.log(np.maximum(np.abs(table[-1]), ROUNDING) / max(usual, ROUNDING)))
    return len(table) > 2 and bool((rising & (apart > np.log(OTHER_SCALE))).any())


GUESSES = [
    Guess(
        "the header",
        "Names say what columns hold; `range_0 … range_180` are a scan, and may be bearings.",
        _by_header,
    ),
    Guess(
        "pairs of a bearing and a range",
        "Bearings and ranges stand by turns, after a stamp and a pose, if any.",
        _by_pairs,
    ),
    Guess(
        "a count",
        "A number is that of the words after it, which are the ranges.",
        _by_count,
    ),
    Guess(
        "the layout of ros2 topic echo --csv",
        "Stamp, frame, bearings and limits of a LaserScan come before its ranges.",
        _by_echo,
    ),
    Guess(
        "the bearings, which go round",
        "A line is a reading: one column goes round, once or often, and the range is next to it.",
        _by_sweep,
    ),
    Guess(
        "the number of columns",
        "As many ranges as a usual range finder has, after a stamp and a pose, if any.",
        _by_length,
    ),
]
