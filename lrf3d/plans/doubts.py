"""Doubts about a plan: what its rules cannot settle, and a person sees at one glance.

The walls and doors of a plan enter; phrases leave, which one line joins and which name
`lrf3d edit`.
"""

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lrf3d.base.errors import Lrf3dWarning
from lrf3d.base.text import Note, counted
from lrf3d.geometry.lines import Bool, Float
from lrf3d.plans.rules.doors import Door
from lrf3d.plans.rules.enclosure import closes_rooms, drawn_cells, shut_share
from lrf3d.plans.rules.sheet import plans_apart
from lrf3d.world.model import SHEET, World

# Least and largest width [m] of a door that is not doubted: a cupboard's, and a double door's.
DOOR = (0.5, 2.0)

# Largest share of the area or of the thick walls of a plan that is left out and not doubted.
LEFT_OUT = 0.1

# Share of a sheet above which a picture may be its plan.
PICTURED = 0.15

# Number of separate plans from which on a sheet is taken for a town of houses, without a warning.
TOWN = 10

# Number of walls up to which a plan need not close a room, as a corridor or a sketch.
FEW = 12


def notes(*facts: str) -> tuple[Note, ...]:
    """Notes on the facts that are not empty."""
    return tuple(Note(each) for each in facts if each)


def of_doors(doors: Sequence[Door]) -> str:
    """A doubt about doors that are too narrow or too wide."""
    wide = np.array([door.width for door in doors])
    odd = np.sort(wide[(wide < DOOR[0]) | (wide > DOOR[1])])
    if not len(odd):
        return ""
    found = " to ".join(dict.fromkeys(f"{each:.2g}" for each in (odd[0], odd[-1])))
    return f"{counted(len(odd), 'door')} of {found} m?"


def of_walls(doors: Sequence[Door]) -> str:
    """A note on doors without a leaf, in walls that go on through them."""
    found = sum(door.slides for door in doors)
    return f"{counted(found, 'doorway')} opened where walls go on" if found else ""


def of_rooms(walls: Float) -> str:
    """A doubt about walls (n, 4) [m] that hardly close a room, or rooms without doors."""
    return "" if len(walls) <= FEW else of_cells(*drawn_cells(walls))


def of_cells(dark: Bool, metre: float) -> str:
    """The same for dark cells, of which there are so many per metre."""
    if not closes_rooms(dark, metre):
        return NO_ROOM
    shut = shut_share(dark, metre)
    return f"no door leads to {shut:.0%} of the rooms" if shut > LEFT_OUT else ""


def of_pictures(share: float) -> str:
    """A doubt about pictures that cover a share of a drawing."""
    return f"a picture covers {min(share, 1):.0%} of it and is not read" if share > PICTURED else ""


# The doubt about walls that close no room.
NO_ROOM = "hardly any of it closes a room: is it a plan?"


def of_outside(out: float, whole: float) -> str:
    """A doubt about a part next to a plan, of areas [m²], that is large for a legend."""
    return f"a part of {out:.3g} m² next to it is left out" if out > LEFT_OUT * whole else ""


def of_dark(share: float) -> str:
    """A doubt about a picture that leaves out a share of what is dark."""
    return f"{share:.0%} of what is dark is left out" if share > 0.5 else ""


def of_thick(thick: Bool, walls: Bool) -> str:
    """A doubt about thick pixels, of which walls are too few."""
    share = float((thick & ~walls).sum()) / max(float(thick.sum()), 1.0)
    return f"{share:.0%} of what is as thick as walls is left out" if share > LEFT_OUT else ""


def warn_of_plans_apart(world: World, path: Path) -> None:
    """Warn of several plans on a sheet: a route is planned in one of them."""
    # On a drawing in the size of its paper, all parts are close enough to be one plan.
    large = np.ptp(world.segments.reshape(-1, 2), axis=0).max() > SHEET
    plans = plans_apart(world.segments) if large else ()
    if 1 < len(plans) < TOWN:
        each = [f"{c - a:.0f} x {d - b:.0f} m at ({a:.1f}, {b:.1f})" for a, b, c, d in plans]
        warnings.warn(
            f"{path}: {len(plans)} plans stand apart ({', '.join(each)}); the route is"
            " planned in one of them: --set robot.start=[x,y,0] chooses which, --layers and"
            " --page choose what is read; `lrf3d world show` draws them",
            Lrf3dWarning,
            stacklevel=5,
        )
