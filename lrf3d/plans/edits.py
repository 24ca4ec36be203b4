"""A user's decisions about a plan, which are kept in a file next to the drawing.

A plan that was read enters, with the values of ``FILE.edit.toml`` or a list of decisions; the plan
leaves with the decisions applied, and with those listed that match nothing any more.
"""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lrf3d.base.errors import WorldError, check_names, expect, shown
from lrf3d.base.files import write_text
from lrf3d.base.text import counted
from lrf3d.plans.decisions import DECISIONS, Class, Decision, Move, Reading, Remove, Scale
from lrf3d.plans.doubts import notes
from lrf3d.plans.plan import Plan
from lrf3d.world.schema import at
from lrf3d.world.toml_file import toml_table, toml_values

# The version of the files that are written, and the newest that is read.
VERSION = 1


@dataclass(frozen=True)
class PlanEdits:
    """The decisions about a drawing, with the name of its file and the digest of its bytes.

    Raises:
        WorldError: A decision is invalid.

    Examples:
        >>> import lrf3d
        >>> from lrf3d.plans.decisions import Doorway, DrawnWall
        >>> from lrf3d.plans.edits import PlanEdits
        >>> edits = PlanEdits([DrawnWall([[0, 0], [4, 0]], height=2.0), Doorway([2, 0], 0.9)])
        >>> edits.as_dict()["doorway"]
        [{'at': [2, 0], 'width': 0.9}]
    """

    decisions: tuple[Decision, ...] = ()
    source: str = ""
    digest: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "decisions", tuple(self.decisions))
        for each in self.decisions:
            expect(each, Decision, "decision")
        for kind in DECISIONS:
            if kind.single and len(self.all(kind)) > 1:
                raise WorldError(f"{kind.key}: decided twice; leave one")

    def all(self, kind: type[Decision]) -> list[Any]:
        """The decisions of a kind."""
        return [each for each in self.decisions if isinstance(each, kind)]

    def one(self, kind: type[Decision]) -> Any:
        """The decision of a kind that occurs at most once, or None."""
        return next(iter(self.all(kind)), None)

    @classmethod
    def of(cls, found: Any) -> "PlanEdits":
        """Decisions from a PlanEdits, a list, the values of a file, or its path."""
        if isinstance(found, PlanEdits):
            return found
        if isinstance(found, str | Path):
            return read_edits(found)
        if isinstance(found, Mapping):
            return cls.from_dict(found)
        if isinstance(found, Iterable):
            return cls(tuple(found))
        raise WorldError(f"edits {shown(found)}: expected a file, or a list of decisions")

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> "PlanEdits":
        """The decisions that a file holds."""
        version = found.get("version", VERSION)
        if not (type(version) is int and 1 <= version <= VERSION):
            raise WorldError(
                f"version {shown(version)}: written by a newer lrf3d; this one reads {VERSION}"
            )
        plain = ("version", "source", "digest")
        check_names("decisions", found, [*plain, *(kind.key for kind in DECISIONS)])
        made = []
        for kind in DECISIONS:
            held = found.get(kind.key, [])
            several = [held] if isinstance(held, Mapping) else held
            if kind.single != isinstance(held, Mapping) and kind.key in found:
                form = f"[{kind.key}]" if kind.single else f"[[{kind.key}]]"
                raise WorldError(f"{kind.key}: expected {form}")
            for place, each in enumerate(several):
                with at(kind.key if kind.single else f"{kind.key}[{place}]"):
                    made.append(kind.of(each))
        names = [str(found.get(name, "")) for name in plain[1:]]
        return cls(tuple(made), *names)

    def as_dict(self) -> dict[str, Any]:
        """The values of its file."""
        tables = dict[str, Any]()
        for kind in DECISIONS:
            held = [each.as_dict() for each in self.all(kind)]
            if held:
                tables[kind.key] = held[0] if kind.single else held
        return {"version": VERSION, "source": self.source, "digest": self.digest, **tables}

    def write(self, path: str | Path) -> None:
        """Write the file of the decisions, completely or not at all."""
        values = self.as_dict()
        plain = {n: v for n, v in values.items() if not isinstance(v, list | dict)}
        blocks = [toml_table("", plain)]
        for name, held in values.items():
            if isinstance(held, dict):
                blocks.append(toml_table(f"[{name}]", held))
            elif isinstance(held, list):
                blocks += [toml_table(f"[[{name}]]", each) for each in held]
        write_text(path, "\n".join(blocks))

    def options(self) -> dict[str, Any]:
        """How the file is read."""
        reading = self.one(Reading)
        scale = self.one(Scale)
        found = {} if reading is None else dict(reading.as_dict())
        return found if scale is None else {**found, "scale": scale.per_unit}

    def applied(self, plan: Plan, name: str) -> Plan:
        """A plan with the decisions applied; those that match nothing any more are named.

        Raises:
            WorldError: None of the selections matches: they belong to another drawing.
        """
        lost = list[str]()
        tried = 0
        for kind in DECISIONS:
            for place, each in enumerate(self.all(kind)):
                changed = each.change(plan)
                tried += kind in (Class, Move, Remove)
                if changed is None:
                    values = ", ".join(f"{n} {shown(v)}" for n, v in each.as_dict().items())
                    lost.append(f"{kind.key}[{place}] ({values})")
                plan = changed or plan
        if len(lost) > 1 and len(lost) == tried == len(self.decisions):
            raise WorldError(f"{name}: none of its {tried} selections is in this drawing")
        count = len(self.decisions) - len(lost)
        said = plan.said + notes(f"{counted(count, 'decision')} of {name}" if count else "")
        return plan._replace(said=said, lost=tuple(lost))


def read_edits(path: str | Path) -> PlanEdits:
    """Read a file of decisions.

    Raises:
        WorldError: It is no such file, or of a newer version.
    """
    with at(str(path)):
        return PlanEdits.from_dict(toml_values(Path(path)))


def digest_of(path: Path) -> str:
    """The digest of the bytes of a file."""
    with open(path, "rb") as file:
        return f"sha256:{hashlib.file_digest(file, 'sha256').hexdigest()}"
