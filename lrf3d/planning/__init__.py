"""Planning: routes past most walls of a world, through its free space."""

from typing import Literal

# Side of the walls: inside, among them, or outside of them.
Side = Literal["inside", "outside"]
