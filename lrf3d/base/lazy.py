"""Loading at first use: public names (PEP 562), and pictures of values, which rooms above draw."""

# Importing it from typing would take as long as all else that ``import lrf3d`` does.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any


def loading(
    module_globals: "dict[str, Any]", modules: "Mapping[str, str]"
) -> "tuple[Callable[[str], object], Callable[[], list[str]]]":
    """The ``__getattr__`` and ``__dir__`` of a package whose public names are loaded at first use.

    Names are given by the module that defines them, relative to the package; modules that are
    names themselves by "".
    """
    package = module_globals["__name__"]
    homes = {name: module for module, names in modules.items() for name in names.split()}

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        # The program must soon reach its own answer to Ctrl-C, so this is not loaded at once.
        from importlib import import_module

        module = import_module(f"{package}.{homes[name] or name}")
        module_globals[name] = value = getattr(module, name) if homes[name] else module
        return value

    return get, lambda: sorted(module_globals["__all__"])


# How values are drawn, entered by the head of the package: the ``figure`` of a value, and a
# ``frame`` and the ``film`` of a run.
ABOVE: "dict[str, Callable[..., Any]]" = {}


class Pictured:
    """Base of values that a notebook shows as a small figure, see :func:`lrf3d.plot.png`."""

    __slots__ = ()

    def _repr_png_(self) -> bytes:
        return bytes(ABOVE["figure"](self))
