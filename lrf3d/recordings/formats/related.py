"""Messages of programs that are related to CARMEN, as CARMEN's: those of GMapping, Player, SICK.

The words of a line enter; those of a message in the layout of CARMEN leave, see `carmen`.
"""

from math import radians

from lrf3d.base.units import LENGTHS, MICRO, MILLI

# Unit of the bearings of a SICK telegram [°].
TELEGRAM_ANGLE = 1e-4

# The bearing of a SICK telegram that points ahead [°].
TELEGRAM_AHEAD = 90

# Numbers of words in a line of Carnegie Mellon's robot data: a pose, or two poses with ranges.
CMU_WORDS = (5, *range(30, 1100))

# Least number of words of a message of Player, as of a pose.
PLAYER_WORDS = 14

# Millimetres for a unit of the ranges of a SICK telegram, by the hexadecimal bits of its scale.
SCALES = {b"3F800000": 1.0, b"40000000": 2.0}


def translated(words: list[bytes]) -> list[bytes]:
    """A message of GMapping, Player or SICK as one of CARMEN."""
    if words[:1] == [b"LASER_READING"]:
        return [b"FLASER", *words[1:-1], *words[-4:]]
    if words[:1] == [b"ODOM"] and len(words) == 5:
        return [*words[:4], b"0", b"0", b"0", words[4], b"", words[4]]
    if words[:1] in ([b"L"], [b"O"]) and len(words) in CMU_WORDS:
        return _of_cmu(words)
    if len(words) >= PLAYER_WORDS and words[3] in (b"laser", b"position2d"):
        return _of_player(words)
    if words[1:2] == [b"LMDscandata"] and b"DIST1" in words:
        return _of_telegram(words, words.index(b"DIST1"))
    return words


def _of_cmu(words: list[bytes]) -> list[bytes]:
    """A line of Carnegie Mellon's robot data: poses and ranges in centimetres, the stamp last."""
    numbers = [float(word) for word in words[1:]]
    x, y, theta, *rest = numbers
    centi = LENGTHS["cm"]
    robot = [centi * x, centi * y, theta]
    if words[0] == b"O":
        return [b"ODOM", *(b"%.9g" % each for each in (*robot, 0, 0, 0, rest[-1])), b"", words[-1]]
    ranges = [centi * each for each in rest[3:-1]]
    found = [len(ranges), *ranges, centi * rest[0], centi * rest[1], rest[2], *robot, rest[-1]]
    return [b"CMU", *(b"%.9g" % each for each in found), b"", words[-1]]


def _of_player(words: list[bytes]) -> list[bytes]:
    """A message of Player: time, host, robot, kind, index, type, subtype and time come first."""
    if words[3] == b"laser" and b"." in words[5]:
        # The first version of Player has no index, type and subtype.
        words = [*words[:5], b"", b"", words[5], b"", *words[6:9], b"0", *words[9:]]
    elif b"." not in words[7] or len(words) == PLAYER_WORDS:
        # The last version has no second time.
        words = [*words[:7], words[0], *words[7:]]
    end = [words[7], *words[1::-1]]
    if words[3] == b"position2d":
        return [b"ODOM", *words[8:12], words[13], b"0", *end]
    start, fov, step, farthest, count = words[9:14]
    fan = [b"0", start, fov, step, farthest, b"0", b"0", count]
    return [b"RAWLASER1", *fan, *words[14::2], b"0", *end]


def _of_telegram(words: list[bytes], at: int) -> list[bytes]:
    """A scan of a SICK range finder, whose first channel of ranges begins at a word.

    Its numbers are hexadecimal: microseconds, ten thousandths of a degree, and units.
    """
    if words[at + 1] not in SCALES:
        raise ValueError(f"a scale of {words[at + 1]!r}, expected 3F800000 or 40000000")
    start, step, count = (int(word, 16) for word in words[at + 3 : at + 6])
    if start >= 1 << 31:
        start -= 1 << 32
    ranges = [SCALES[words[at + 1]] * int(word, 16) for word in words[at + 6 : at + 6 + count]]
    first = radians(TELEGRAM_ANGLE * start - TELEGRAM_AHEAD)
    fan = [first, 0.0, radians(TELEGRAM_ANGLE * step), 0.0, 0.0, 0.0, count]
    stamp = MICRO * int(words[9], 16)
    numbers = [0.0, *fan, *(MILLI * each for each in ranges), 0.0, stamp]
    return [b"RAWLASER1", *(b"%.9g" % number for number in numbers), b"", b"%.9g" % stamp]
