"""Reading plans: the file of a drawing or a picture enters, its walls and doors leave.

The user's decisions about the drawing, from the file next to it, are applied.
"""

from importlib import import_module
from pathlib import Path
from typing import Any

from lrf3d.base.errors import WorldError
from lrf3d.plans.canvas import PerUnit
from lrf3d.plans.doubts import notes
from lrf3d.plans.parts import Parts
from lrf3d.plans.plan import Plan, plan_of
from lrf3d.world.files import edits_path, find_world, is_picture, is_plan, load_world, read_world
from lrf3d.world.model import check_scale
from lrf3d.world.schema import at


def read_plan(
    path: str | Path,
    edits: Any = None,
    *,
    scale: float = 1.0,
    isolated: bool = True,
    **options: Any,
) -> Plan:
    """Read the plan of a drawing or a picture: the walls and doors that `load_world` starts from.

    Args:
        path: A file: .dxf, .svg, .pdf, .png, .pgm, .jpg or .bmp; or a world that is to be edited.
        edits: Decisions about it: their file, a list of them, or a
            :class:`~lrf3d.plans.edits.PlanEdits`. If not given, those of ``FILE.edit.toml``, if
            it exists; ``()`` for none.
        scale: Enlarges the plan, but not the heights.
        isolated: Read the file in a process of its own, with limits on memory and time.
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
        >>> from lrf3d.plans.decisions import Doorway, DrawnWall
        >>> edits = [DrawnWall([[4, 2], [4, 6]], material="glass"), Doorway([4, 3], 0.9)]
        >>> len(lrf3d.read_plan("room.svg", edits).doors)
        1
    """
    path = find_world(path)
    check_scale(scale)
    if edits is None and edits_path(path).is_file():
        edits = edits_path(path)
    if edits is None:
        return drawn_plan(path, scale, isolated, **options)
    # Imported here, since the process that reads a drawing needs no decisions.
    from lrf3d.plans.edits import PlanEdits, digest_of

    found = PlanEdits.of(edits)
    name = Path(edits).name if isinstance(edits, str | Path) else "edits"
    with at(str(path)):
        if found.source and found.source != path.name:
            other = f"{name} is of another drawing, {found.source}"
            raise WorldError(f"{other}; choose that, or remove it")
        how = found.options()
        if "scale" in how and scale != 1.0:
            raise WorldError(f"--scale: {name} has a scale; leave one out")
        plan = drawn_plan(path, **{"scale": scale, "isolated": isolated, **options, **how})
        changed = found.digest and found.digest != digest_of(path)
        said = f"{path.name} has changed since it was edited" if changed else ""
        return found.applied(plan._replace(said=plan.said + notes(said)), name)


def drawn_plan(
    path: Path, scale: float | PerUnit = 1.0, isolated: bool = True, **options: Any
) -> Plan:
    """The plan of a drawing without decisions, or of the walls of a world."""
    if is_plan(path):
        reader = "lrf3d.world.files:value_of_file"
        plan: Plan = read_world(reader, path, scale, isolated, options)
        return plan
    factor = scale.metres if isinstance(scale, PerUnit) else scale
    world = load_world(path, edits=(), isolated=isolated, scale=factor, **options)
    return Plan(Parts.of_world(world), base=world)


def plan_of_file(
    path: Path,
    scale: float | PerUnit = 1.0,
    layers: Any = (),
    without: Any = (),
    **options: Any,
) -> Plan:
    """Read the plan of a file with the reader of its format."""
    if is_picture(path):
        from lrf3d.plans.readers.picture import read_picture

        if isinstance(scale, PerUnit):
            return read_picture(path, **{**options, "resolution": scale.metres})
        return read_picture(path, **options).scaled(scale)
    draw = import_module(f"lrf3d.plans.readers.{path.suffix[1:].lower()}").draw
    found = draw(path, scale, **options)
    # A scanned page of a PDF is a plan already: it was read as a picture, without layers.
    if isinstance(found, Plan):
        return found
    plan = plan_of(found, layers, without)
    if layers or not plan.layers or len(plan.segments):
        return plan
    # Only advise layers that were tried.
    tried = plan_of(found, ["*"], without).parts
    return plan._replace(wall_layers=[*dict.fromkeys(tried.layers[tried.stands])])
