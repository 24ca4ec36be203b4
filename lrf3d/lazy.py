"""Public names that are loaded when they are first used (PEP 562)."""

from importlib import import_module

# Importing it from typing would take as long as all else that ``import lrf3d`` does.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any


def loading(
    module_globals: "dict[str, Any]", modules: "Mapping[str, str]"
) -> "tuple[Callable[[str], object], Callable[[], list[str]]]":
    """The ``__getattr__`` and ``__dir__`` of a package whose public names are loaded at first use.

    Args:
        module_globals: ``globals()`` of the package; a name that was loaded is kept there.
        modules: For each name the module that defines it, relative to the package; "" where the
            name is that of a module.

    Examples:
        ``__getattr__, __dir__ = loading(globals(), {"LineMapper": "mapper"})``
    """
    package = module_globals["__name__"]

    def get(name: str) -> object:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home = modules[name]
        module = import_module(f"{package}.{home or name}")
        value = getattr(module, name) if home else module
        module_globals[name] = value
        return value

    def names() -> list[str]:
        return sorted(module_globals["__all__"])

    return get, names
