"""lrf3d: a robot with a laser range finder in a world of walls, simulated, mapped and filmed.

The public names, which stand in the stub next to this file, are loaded when they are first used, so
that ``import lrf3d`` costs next to nothing and loads no more than a program needs.
"""

from lrf3d.base.lazy import ABOVE, loading

# Importing it from typing would take as long as all that is needed to handle Ctrl-C.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from lrf3d.simulation.run import Run

_homes: "dict[str, str]" = {}
with open(f"{__file__}i", encoding="utf-8") as _stub:
    for _words in map(str.split, _stub):
        if _words[:1] == ["from"]:
            _home = _words[1].removeprefix("lrf3d").lstrip(".")
            _homes[_home] = f"{_homes.get(_home, '')} {_words[3]}"

__getattr__, __dir__ = loading(globals(), _homes)
__all__ = sorted(name for names in _homes.values() for name in names.split() if name[0] != "_")


def _figure(value: "Any") -> bytes:
    from lrf3d.studio.figures.plot import png

    return png(value)


def _frame(run: "Run", *args: "Any", **options: "Any") -> "Any":
    from lrf3d.studio.render.film import frame

    return frame(run, *args, **options)


def _film(run: "Run", *args: "Any", **options: "Any") -> "Any":
    from lrf3d.studio.render.video import render_video

    return render_video(run, *args, **options)


# The studio draws values; it is loaded with the first picture.
ABOVE.update(figure=_figure, frame=_frame, film=_film)
