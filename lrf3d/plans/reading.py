"""Reading plans: the file of a drawing or a picture enters, its walls and doors leave."""

from importlib import import_module
from pathlib import Path
from typing import Any

from lrf3d.plans.plan import Plan, plan_of
from lrf3d.world.files import is_picture, read_world


def read_plan(
    path: str | Path, *, scale: float = 1.0, isolated: bool = True, **options: Any
) -> Plan:
    """Read the plan of a drawing or a picture: the walls and doors that `load_world` starts from.

    Args:
        path: The file: .dxf, .svg, .pdf, .png, .pgm, .jpg or .bmp.
        scale: Enlarges the plan, but not the heights.
        isolated: Whether it is read in a process of its own, with limits.
        options: ``resolution``, ``threshold``, ``layers``, ``without`` and ``page``, as for
            `load_world`.

    Raises:
        WorldError: The file cannot be used, or an option is given that its format does not have.

    Examples:
        >>> from pathlib import Path
        >>> import lrf3d
        >>> room = '<rect width="6000" height="4000" fill="none"/>'
        >>> sheet = '<svg width="8m" height="6m" viewBox="0 0 8000 6000" stroke="black">'
        >>> _ = Path("room.svg").write_text(f"{sheet}{room}</svg>")
        >>> len(lrf3d.read_plan("room.svg").segments)
        4
    """
    plan: Plan = read_world("lrf3d.world.files:value_of_file", path, scale, isolated, options)
    return plan


def plan_of_file(
    path: Path, scale: float = 1.0, layers: Any = (), without: Any = (), **options: Any
) -> Plan:
    """Make the plan of a file by the reader of its format."""
    if is_picture(path):
        from lrf3d.plans.readers.picture import read_picture

        return read_picture(path, **options).scaled(scale)
    draw = import_module(f"lrf3d.plans.readers.{path.suffix[1:].lower()}").draw
    found = draw(path, scale, **options)
    # A scanned page of a PDF is a plan already: it was read as a picture, without layers.
    return found if isinstance(found, Plan) else plan_of(found, layers, without)
