"""Users' own mappers, controllers and noises, named as ``module:object``.

Only what the user names is ever imported: nothing that a world file or a log says is run.
"""

import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError
from lrf3d.study.guarded import Guarded


@dataclass(frozen=True, slots=True)
class Plugin:
    """An object of the user's, and how it is made anew for each run.

    Args:
        name: ``module:object``; empty for one that was handed over.
        found: What stands there: a class, which is called without arguments, or an object.
        needs: The method that it must have; it must be callable where there is none.
        kind: What it is to be.
    """

    name: str
    found: Any
    needs: str
    kind: str

    def make(self) -> Any:
        """A new object of the class, or the object; what a named one raises bears its name.

        Raises:
            InputError: The class cannot be made, or what it makes lacks the method.
        """
        made = self.found
        if isinstance(made, type):
            try:
                made = made()
            except Exception as error:
                words = " ".join(str(error).split())
                raise InputError(
                    f"--{self.kind} {self.name}: cannot be made without arguments"
                    f" ({type(error).__name__}: {words}); name an object, or give its arguments"
                    " defaults"
                ) from error
        if not callable(getattr(made, self.needs, None)):
            method = f"a method {self.needs}" if self.needs != "__call__" else "a function"
            raise InputError(f"--{self.kind} {self.name}: has no {_expected(self.kind, method)}")
        return Guarded(made, f"--{self.kind} {self.name}") if self.name else made


NEEDS = {"mapper": "update", "controller": "command", "noise": "__call__"}
"""The method that each kind of plug-in must have."""

_FORMS = {
    "mapper": "update(scan)",
    "controller": "command(time, pose, scan) -> (v, w)",
    "noise": "__call__(scan, rng) -> scan",
}


def _expected(kind: str, method: str) -> str:
    return f"{method.removeprefix('a ')}; expected {_FORMS[kind]}"


def load_plugin(kind: str, name: str) -> Plugin:
    """Find what is named ``module:object``; modules in the current folder are found as well.

    Args:
        kind: ``mapper``, ``controller`` or ``noise``.
        name: The name, with dots in both parts where needed; a path of a file ``.py`` may stand
            for the module.

    Raises:
        InputError: The name is none, or there is no such module or object.
    """
    module_name, colon, path = name.rpartition(":")
    if not (colon and module_name and path):
        raise InputError(f"--{kind} {name}: expected module:object, such as mymodule:MyClass")
    try:
        module = _import(module_name)
    except ModuleNotFoundError as error:
        where = f"in {Path.cwd()} or among the installed modules"
        raise InputError(f"--{kind} {name}: no module {error.name!r} {where}") from None
    except Exception as error:
        reason = " ".join(str(error).split())
        raise InputError(
            f"--{kind} {name}: {module_name} cannot be imported ({type(error).__name__}: {reason})"
        ) from error
    found: Any = module
    for part in path.split("."):
        if not hasattr(found, part):
            public = [item for item in vars(found) if not item.startswith("_")]
            near = _nearest(part, public)
            raise InputError(f"--{kind} {name}: {module_name} has no {part!r}{near}")
        found = getattr(found, part)
    return Plugin(name, found, NEEDS[kind], kind)


def _import(name: str) -> Any:
    """Import a module by its name, or a file by its path."""
    folder = Path.cwd()
    if name.endswith(".py"):
        file = Path(name).resolve()
        if not file.is_file():
            raise ModuleNotFoundError(name=name)
        folder, name = file.parent, file.stem
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))
    return import_module(name)


def _nearest(name: str, names: list[str]) -> str:
    from difflib import get_close_matches

    near = get_close_matches(name, names, n=1)
    return f"; did you mean {near[0]}?" if near else ""
