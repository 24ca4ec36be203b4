"""From the words of a command line to the values of its options, after the command's help page."""

import argparse
import math
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from difflib import get_close_matches
from functools import partial
from keyword import iskeyword
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from lrf3d.apps.cli.commands import COMMANDS, OUTPUT
from lrf3d.apps.cli.console import say
from lrf3d.base.errors import InputError, check_names, shown
from lrf3d.base.text import table

_LINE = re.compile(r"((?:-\w )?--[\w-]+|\[?[A-Z|]+\]?(?:\.\.\.)?)(?: (\S+))??(?: = (\S+))?: (.*)")

# What other programs call an option, by the words that `_plain` gives.
ELSEWHERE = {
    **dict.fromkeys(("duration", "n", "seconds", "steps", "time"), "--scans"),
    **dict.fromkeys(("repeats", "runs", "trials"), "--seeds"),
    **dict.fromkeys(("dir out", "dir output", "outdir", "output", "results"), "--out"),
}


class Option(NamedTuple):
    """A line of a help page: an option, or an argument, whose name is in capitals."""

    names: list[str]
    value: str
    default: str | None
    help: str


def run_command(words: Sequence[str]) -> int | None:
    """Run the command that words name, and return its exit status, which is 2 for wrong usage."""
    try:
        args = parse(words)
    except InputError as error:
        say(str(error))
        return 2
    from lrf3d.base.lean import lean_loading

    with lean_loading():
        from lrf3d.apps.cli.inputs import start
    return start(args)


def parse(words: Sequence[str]) -> argparse.Namespace:
    """The name of the command, and its options by their names; may print a help page and exit.

    Raises:
        InputError: The words are not a command and what it takes.
    """
    if words[:1] == ["help"]:
        words = [*words[1:], "--help"]
    name = next((each for each in (" ".join(words[:2]), *words[:1]) if each in COMMANDS), None)
    if name is None:
        _without_command(words)
    parser, options = _parser(name)
    # What follows is for ROS.
    end = list(words).index("--ros-args") if name == "ros" and "--ros-args" in words else len(words)
    joined = _joined(words[len(name.split()) : end], options)
    flags = [word.partition("=")[0] for word in joined if word.startswith("-")]
    named = argparse.Namespace(command=name, ros_words=words[end:], flags=flags)
    given, rest = parser.parse_known_intermixed_args(joined, named)
    unknown = [word.partition("=")[0] for word in rest if word.startswith("-")]
    _refuse_unknown(unknown, options, parser.prog)
    if rest:
        parser.error(f"unexpected {' '.join(rest)}")
    return given


def _refuse_unknown(unknown: Sequence[str], options: Sequence[Option], program: str) -> None:
    """Refuse unknown options, and propose the nearest one, or a key of world files."""
    known = [flag for option in options for flag in option.names if flag.startswith("--")]
    words = {_plain(flag): flag for flag in known}
    if unknown and "--set" in known:
        from lrf3d.simulation.tables import SENSORS, TABLES, keys_of_table

        for table in (*TABLES, *SENSORS):
            for key in keys_of_table(table):
                words.setdefault(_plain(key), f"--set {table}.{key}=VALUE")
    for word, flag in ELSEWHERE.items():
        if flag in known:
            words.setdefault(word, flag)
    for flag in unknown:
        # A key in another order, a part of what was meant, and letters in another order.
        near = [_plain(flag)] * (_plain(flag) in words) or [
            *(word for word in _plain(flag).split() if f"--{word}" in known),
            *get_close_matches(_plain(flag), words, n=1, cutoff=0.7),
            *map(_plain, get_close_matches(flag, known, n=1, cutoff=0.75)),
        ]
        hint = f"did you mean {words[near[0]]!r}?" if near else f"see {program} -h"
        raise InputError(f"{program.partition(' ')[2]}: there is no {shown(flag)}; {hint}")


def _plain(name: str) -> str:
    """A name without dashes, its words in the order of letters: `--max-range` is `range_max`."""
    return " ".join(sorted(re.findall(r"[^-_]+", name)))


def _joined(words: Sequence[str], options: Sequence[Option]) -> list[str]:
    """Words in which a list of numbers is one: ``--sigma 0.1 0.2`` is ``--sigma 0.1,0.2``."""
    several = [flag for option in options if option.value.endswith(",…") for flag in option.names]
    valued = [flag for option in options if option.value for flag in option.names]
    joined: list[str] = []
    end = [*words, "--"].index("--")
    # What comes after `--` is no option.
    names = [f"./{word}" if word.startswith("-") else word for word in words[end + 1 :]]
    # A word that is a number, or meant to be one.
    number = r"[-+]?\.?[0-9][0-9.eE+-]*"
    for word in [*words[:end], *names]:
        if joined[-2:-1] and joined[-2] in several and re.fullmatch(number, word):
            joined[-1] += f",{word}"
        elif (
            joined and joined[-1] in valued and joined[-1][:2] == "--" and re.match(r"-\.?\d", word)
        ):
            # Otherwise it would be an option.
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message.removeprefix('argument ')}; see {self.prog} -h")


def _parser(name: str) -> tuple[argparse.ArgumentParser, list[Option]]:
    parts = [*lists(name)]
    options = [option for _, found in parts for option in found]
    arguments = [option.names[0] for option in options if option.names[0][0] != "-"]
    parser = _Parser(
        prog=f"lrf3d {name}",
        usage=" ".join(["lrf3d", name, *arguments, "[OPTIONS]"]),
        description="\n\n".join(text for text, found in parts[:-1] if not found),
        epilog=parts[-1][0],
        formatter_class=partial(argparse.HelpFormatter, max_help_position=30),
        add_help=False,
        allow_abbrev=False,
    )
    for title, found in parts:
        if found:
            group = parser.add_argument_group(title)
            for option in found:
                _add(group, option)
    return parser, options


def _without_command(words: Sequence[str]) -> NoReturn:
    """Print the version, or the commands of all or of a group, and exit; or raise an InputError."""
    groups = {name.split()[0] for name in COMMANDS if " " in name}
    group, words = (f"{words[0]} ", words[1:]) if words[:1] and words[0] in groups else ("", words)
    if words[:1] == ["--version"]:
        import lrf3d

        print(f"lrf3d {lrf3d.__version__}")
        sys.exit()
    if words and words[0] not in ("-h", "--help"):
        check_names("commands", [group + words[0]], [*COMMANDS, "help"])
    print(overview(group), file=sys.stdout if words else sys.stderr)
    sys.exit(0 if words else 2)


def _add(group: Any, option: Option) -> None:
    names, value, default, text = option
    name = names[-1].strip("-[].").split("|")[-1].replace("-", "_").lower()
    name = f"{name}_" if iskeyword(name) else name
    shown = f"{text} [default: {default}]" if default else text
    read: dict[str, Any] = {"type": partial(read_value, value or names[-1]), "default": default}
    if names[0][0] != "-":
        many = "?" if names[0][0] == "[" else "+" if names[0].endswith("...") else None
        group.add_argument(name, metavar=names[0].strip("[]."), nargs=many, help=shown, **read)
    elif value:
        action = "extend" if "…" in value or "=" in value else "store"
        read |= {"required": text.endswith("(required)."), "metavar": value, "help": shown}
        group.add_argument(*names, dest=name, action=action, **read)
    elif default is not None:
        group.add_argument(*names, action=argparse.BooleanOptionalAction, default=True, help=text)
    else:
        action = "help" if name == "help" else "store_true"
        group.add_argument(*names, action=action, help=text)


def read_value(kind: str, word: str) -> Any:
    """What a word says, by what a help page calls it; a list of one or more where several may."""
    unit, several, _ = kind.partition(",") if kind.endswith("…") else (kind, "", "")
    read, expected = _choice(unit) if unit == unit.lower() else KINDS.get(unit, (str, unit))
    try:
        if "=" in kind:
            return [word]
        if several:
            parts = [part.strip() for part in word.split(",") if part.strip()]
            return [read(part) for part in parts or [""]]
        return read(word)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{shown(word)}: expected {expected}") from None


def _choice(unit: str) -> tuple[Callable[[str], str], str]:
    """What reads one of some words, and what it expects."""
    choices = unit.split("|")
    return lambda word: choices[choices.index(word)], " or ".join(choices)


def _number(
    kind: Callable[[str], float], least: float, most: float = math.inf
) -> tuple[Callable[[str], float], str]:
    """What reads a number within limits, and what it expects."""

    def read(word: str) -> float:
        number = kind(word)
        if not least <= number <= most:
            raise ValueError
        return number

    what = "a whole number" if kind is int else "a number"
    return read, f"{what} from {least:g}" + (f" to {most:g}" if most < math.inf else "")


def _path(word: str) -> Path:
    if not word:
        raise ValueError
    return Path(word)


def _two(
    mark: str, fits: Callable[[Any, Any], bool], kind: Callable[[str], float] = int
) -> Callable[[str], tuple[float, float]]:
    """The parser of two numbers, integers by default, with a separator between them."""

    def read(word: str) -> tuple[float, float]:
        first, second = map(kind, word.lower().split(mark))
        if not fits(first, second):
            raise ValueError
        return first, second

    return read


def _mapper(word: str) -> str:
    """A mode of the LineMapper, or the name of a user's mapper."""
    if ":" not in word and word not in ("robust", "paper"):
        raise ValueError
    return word


# What reads a value, and what it expects, by what a help page calls it; others are texts.
KINDS: dict[str, tuple[Callable[[str], Any], str]] = {
    "N": _number(int, 1),
    "SEED": _number(int, 0),
    "PORT": _number(int, 1, 65535),
    "PROCESSES": _number(int, 1, 512),
    "RATE": _number(float, 0.1, 1000.0),
    "SPEED": _number(float, 0.01),
    "GREY": _number(float, 1.0, 254.0),
    "SHARE": _number(float, 0.0, 1.0),
    **dict.fromkeys(("DEG", "FACTOR", "M", "S"), _number(float, 0.0)),
    **dict.fromkeys(("FILE", "FOLDER", "LOG", "RUN", "TO"), (_path, "a path")),
    "WxH": (  # H.264 needs even numbers.
        _two("x", lambda *size: all(side % 2 == 0 and 64 <= side <= 7680 for side in size)),
        "WIDTHxHEIGHT, such as 1280x720, even numbers from 64 to 7680",
    ),
    "NAME": (_mapper, "robust, paper or FILE.py:NAME"),
    "LOW,HIGH": (
        _two(",", lambda low, high: low < high, float),
        "two heights in metres, the lower one first, such as 0.2,0.6",
    ),
    "A:B": (
        _two(":", lambda *pair: min(pair) >= 0 and pair[0] != pair[1]),
        "two numbers of scans, such as 120:2400",
    ),
    "FROM:TO": (
        _two(":", lambda *ends: max(map(abs, ends)) <= 360 and ends[0] != ends[1], float),
        "two bearings in degrees, such as 130:140",
    ),
    "I/N": (
        _two("/", lambda job, jobs: 1 <= job <= jobs),
        "I/N, such as 2/8 for the second of eight jobs",
    ),
}


def lists(name: str) -> Iterator[tuple[str, list[Option]]]:
    """The parts of a help page: lists of options with their titles, and paragraphs without any."""
    text, _, example = COMMANDS[name].rpartition("\n\n")
    for part in (*text.split("\n\n"), OUTPUT, example):
        rows = [_LINE.fullmatch(line) for line in part.replace("\n ", " ").splitlines()]
        title = part if rows[-1] is None else "Options" if rows[0] else part.partition(":\n")[0]
        yield title, [Option(row[1].split(), row[2] or "", row[3], row[4]) for row in rows if row]


def overview(group: str = "") -> str:
    """The list of all commands, or of a group."""
    rows = [
        (f"  {n}", text.partition("\n")[0]) for n, text in COMMANDS.items() if n.startswith(group)
    ]
    return (
        f"usage: lrf3d {group}COMMAND\n\n"
        "Simulate a robot with a laser range finder, map its world, and film it.\n\n"
        f"Commands:\n{table((), rows, left=(0, 1))}\n\n"
        "lrf3d help COMMAND shows the options of a command, lrf3d --version the version.\n\n"
        "Example: lrf3d run city"
    )
