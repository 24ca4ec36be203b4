"""Users' own mappers, controllers and noises, named as ``module:object``.

Only what the user names is ever imported: nothing in a world file or a log is executed.
"""

import inspect
import os
import re
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from importlib import import_module
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any

from lrf3d.errors import InputError, Lrf3dError


@dataclass(frozen=True, slots=True)
class Plugin:
    """A user's object, or class to instantiate for each run.

    Args:
        name: ``module:object``.
        found: A class, which is instantiated without arguments, or an object.
        needs: The method that it must have.
        kind: ``mapper``, ``controller`` or ``noise``.
    """

    name: str
    found: Any
    needs: str
    kind: str

    def make(self) -> Any:
        """A new object of the class, or the object, guarded so that errors name it.

        Raises:
            InputError: The class cannot be instantiated, or the object lacks the method.
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
        return Guarded(made, f"--{self.kind} {self.name}")


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
    """Find ``module:object``; modules in the current folder are found as well.

    A file is loaded itself, even if another module has its name. Its folder is searched last for
    the modules that it imports, so that none of them replaces an installed one.

    Args:
        kind: ``mapper``, ``controller`` or ``noise``.
        name: The name; the path of a ``.py`` file may replace the module.

    Raises:
        InputError: The name is invalid, or there is no such module or object.
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


def slam_plugin(seed: int) -> Plugin:
    """The mapper of ``--slam``, with the noise of its odometry from a seed."""
    from lrf3d.slam.simulated import SlamMapper

    class SeededSlam(SlamMapper):
        def __init__(self) -> None:
            super().__init__(rng=seed)

    return Plugin("lrf3d.slam:SlamMapper", SeededSlam, NEEDS["mapper"], "mapper")


def _import(name: str) -> Any:
    """Import a module by its name, or a file by its path."""
    file = Path(f"{name}.py" if name.isidentifier() else name)
    if file.suffix == ".py" and file.is_file():
        return _load(file.resolve())
    if name.endswith(".py"):
        raise ModuleNotFoundError(name=name)
    _find_also_in(Path.cwd())
    return import_module(name)


def _load(file: Path) -> ModuleType:
    """Run a file as a module, once, even if another module has its name."""
    name = file.stem
    if not _is_free(name, file):
        name = f"{name}_{sha256(os.fsencode(file)).hexdigest()[:12]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError(name=str(file))
    module = module_from_spec(spec)
    _find_also_in(file.parent)
    # Warnings of the user's own file are shown.
    warnings.filterwarnings("default", module=re.escape(name))
    # Dataclasses and pickle look up a class in the module of this name.
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _is_free(name: str, file: Path) -> bool:
    """Whether no other module has, or would be imported by, the name of a file."""
    if name in sys.modules:
        known = getattr(sys.modules[name], "__file__", None)
    elif name.isidentifier():
        spec = find_spec(name)
        if spec is None:
            return True
        known = spec.origin
    else:
        return False
    return known is not None and Path(known).resolve() == file


def _find_also_in(folder: Path) -> None:
    """Add a folder to the end of the search path of modules."""
    if str(folder) not in sys.path:
        sys.path.append(str(folder))


def _nearest(name: str, names: list[str]) -> str:
    from difflib import get_close_matches

    near = get_close_matches(name, names, n=1)
    return f"; did you mean {near[0]}?" if near else ""


METHODS = {"update", "command", "report", "state", "restore"}
"""The methods of mappers and controllers that lrf3d calls; a noise is called itself."""

COPY_FIRST = (
    "copy what is to be changed, as ranges = scan.ranges.copy(), and return"
    " dataclasses.replace(scan, ranges=ranges)"
)
"""The remedy for a plug-in that writes to its read-only scan."""


class Guarded:
    """A plug-in whose errors are reported in one line, with its name and the line of code.

    It behaves like the plug-in, but its exceptions become InputErrors with the original one as
    their cause.

    Args:
        made: The plug-in.
        label: The option that named it: ``--mapper module:object``.
    """

    def __init__(self, made: Any, label: str) -> None:
        self._made, self._label = made, label
        # Recordings identify the plug-in by this.
        self.__wrapped__ = made
        if callable(made):
            # The number of arguments of a noise is that of the user's function.
            self.__signature__ = inspect.signature(made)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._made, name)
        if name in METHODS and callable(found):
            return lambda *arguments: called(self._label, found, *arguments)
        return found

    def __call__(self, *arguments: Any) -> Any:
        """Call the plug-in."""
        return called(self._label, self._made, *arguments)

    def __repr__(self) -> str:
        return self._label


def called(label: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a user's function.

    Raises:
        InputError: It fails; the message names the plug-in, the error and the line of code.
    """
    try:
        return function(*arguments)
    except Lrf3dError:
        raise
    except Exception as error:
        words = " ".join(str(error).split())
        if isinstance(error, ValueError) and words.endswith("read-only"):
            words += f"; {COPY_FIRST}"
        place = extract_tb(error.__traceback__)[-1]
        raise InputError(
            f"{label}: {type(error).__name__}: {words} ({Path(place.filename).name},"
            f" line {place.lineno})"
        ) from error
