"""Users' own mappers, controllers and noises, named as ``module:object``.

Only what the user names is ever imported: nothing in a world file or a log is executed. Errors in
a user's own code keep their traceback.
"""

import sys
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from lrf3d.errors import InputError, check_names

FORMS = {
    "mapper": ("update", "a method update(scan)"),
    "controller": ("command", "a method command(time, pose, scan) -> (v, w)"),
    "noise": ("__call__", "a function of (scan, rng) that returns a scan"),
}
"""The method that each kind of plug-in must have, and its form."""


def load_plugin(kind: str, name: str) -> Any:
    """Find a user's object, or a class to instantiate without arguments for each run.

    The name is ``module:object``; the path of a ``.py`` file may replace the module.
    """
    (module_name, _, path), place = name.rpartition(":"), f"--{kind} {name}"
    if not (module_name and path):
        raise InputError(f"{place}: expected module:object, such as mymodule:MyClass")
    file = Path(f"{module_name}.py" if module_name.isidentifier() else module_name)
    is_file = file.suffix == ".py" and file.is_file()
    folder, plain = (file.resolve().parent, file.stem) if is_file else (Path.cwd(), module_name)
    # At the end, so that no file of the folder replaces an installed module.
    sys.path.append(str(folder))
    try:
        if not all(part.isidentifier() for part in plain.split(".")):
            raise ModuleNotFoundError(name=plain)
        found: Any = import_module(plain)
    except ModuleNotFoundError as error:
        if error.name != plain and not plain.startswith(f"{error.name}."):
            raise
        missing = f"no module {module_name!r} in {Path.cwd()} or installed"
        if file.suffix == ".py" and not module_name.isidentifier():
            missing = f"no such file in {Path.cwd()}"
        raise InputError(f"{place}: {missing}") from None
    if is_file and Path(found.__file__ or "").resolve() != file.resolve():
        raise InputError(f"{place}: another module is called {plain}; rename the file")
    for part in path.split("."):
        check_names(place, [part], [each for each in dir(found) if each[0] != "_"])
        found = getattr(found, part)
    method, form = FORMS[kind]
    if not (callable(found) if method == "__call__" else hasattr(found, method)):
        raise InputError(f"{place}: expected {form}")
    return found


def made(found: Any) -> Any:
    """The object that a user names, or a new one of the class."""
    return found() if isinstance(found, type | partial) else found
