"""Materials of walls: what becomes of a laser's light at them.

The shares are those at 905 nm, at which most laser range finders work. A material returns light to
the laser diffusely (Lambert's law), in a lobe about the mirrored direction, and as a
retro-reflector. What a smooth surface mirrors and what passes through goes on as a beam; a pane
with a refractive index divides the two after Fresnel's equations.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from lrf3d.base.errors import WorldError, check_names, shown
from lrf3d.geometry.lines import ROUNDING, number
from lrf3d.world.schema import at, check_unique, made


@dataclass(frozen=True, slots=True)
class Material:
    """What a wall does to the light of a laser.

    Args:
        name: Its name, by which objects of a world file refer to it.
        diffuse: Share of the light that is reflected diffusely; 1 is a white wall.
        specular: Share that is reflected in a lobe about the mirrored direction.
        lobe_deg: Standard deviation of that lobe [°]. Up to 1° the surface is a mirror: the beam
            goes on in the mirrored direction. With 0 no light of the lobe returns to the laser.
        transmission: Share that passes straight through.
        index: Refractive index of a pane, or 0. The shares that it mirrors and lets through, of
            what is not reflected diffusely, then follow from Fresnel's equations.
        retro: Brightness of a retro-reflector, relative to a white wall.

    Raises:
        WorldError: A value is out of range, or the shares are more than 1 together.

    Examples:
        >>> from lrf3d.world import Material
        >>> Material("frosted glass", diffuse=0.2, transmission=0.6).passes
        True
        >>> Material.of("mirror").mirrors
        True
    """

    name: str
    diffuse: float = 0.0
    specular: float = 0.0
    lobe_deg: float = 0.0
    transmission: float = 0.0
    index: float = 0.0
    retro: float = 0.0

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and self.name):
            raise WorldError(f"material {shown(self.name)}: expected a name")
        called = f"material {self.name!r}"
        with at(called):
            for key, most in LIMITS.items():
                object.__setattr__(self, key, number(getattr(self, key), key, most=most))
        if self.diffuse + self.specular + self.transmission > 1.0 + ROUNDING:
            raise WorldError(f"{called}: diffuse, specular and transmission are over 1 together")
        if self.index and (self.index < 1.0 or self.specular or self.transmission):
            expected = "1 or more, and neither specular nor transmission, which follow from it"
            raise WorldError(f"{called}: index is {self.index:g}; expected {expected}")

    @classmethod
    def of(cls, value: "str | Material") -> "Material":
        """The material itself, or the built-in one of a name."""
        return value if isinstance(value, Material) else named(value)

    @property
    def mirrors(self) -> bool:
        """Whether a beam goes on in the mirrored direction; in a wide lobe its light scatters."""
        return bool(self.specular or self.index) and self.lobe_deg <= 1.0

    @property
    def passes(self) -> bool:
        """Whether a beam goes on straight through."""
        return bool(self.transmission or self.index)

    @property
    def optics(self) -> tuple[float, ...]:
        """The values that kernels take: those of the fields after the name, the lobe in rad."""
        diffuse, specular, lobe, *others = (getattr(self, key) for key in LIMITS)
        return (diffuse, specular, math.radians(lobe), *others)

    def as_dict(self) -> dict[str, Any]:
        """The name and the values that are not 0, as a world file has them."""
        return {key: value for key, value in asdict(self).items() if value}


# Largest value of each field but the name.
LIMITS = dict.fromkeys(("diffuse", "specular", "lobe_deg", "transmission"), 1.0)
LIMITS |= {"lobe_deg": 90, "index": 10, "retro": 10**6}

# The materials that every world knows, by name: round numbers, typical of new and dry surfaces.
BUILT_IN = {
    material.name: material
    for material in (
        Material("plaster", diffuse=0.8),
        Material("brick", diffuse=0.35),
        Material("asphalt", diffuse=0.15),
        Material("bark", diffuse=0.3),
        Material("dark cloth", diffuse=0.05),
        Material("metal", diffuse=0.2, specular=0.5, lobe_deg=8.0),
        Material("glass", diffuse=0.01, lobe_deg=0.5, index=1.52),
        Material("mirror", specular=0.95),
        Material("retro-reflector", diffuse=0.2, retro=300.0),
    )
}

# The material of walls without one.
PLAIN = BUILT_IN["plaster"]


def named(value: object, own: Iterable[Material] = (), place: str = "material") -> Material:
    """The material of a name at a place, among those of a file and the built-in ones."""
    known = {**BUILT_IN, **{material.name: material for material in own}}
    with at(place):
        check_names(place, [str(value)], known)
    return known[str(value)]


def material_of(value: object) -> Material | None:
    """A material from the properties of a file: a name, which may be unknown, or its values."""
    if isinstance(value, dict):
        own: Material = made(Material)({"name": "", **value}, "material")
        return own
    name = str(value).strip().lower()
    # Other values of OpenStreetMap's key ``building:material``.
    aliases = {"cement_block": "plaster", "concrete": "plaster"}
    aliases |= {"metal_plates": "metal", "steel": "metal"}
    return BUILT_IN.get(aliases.get(name, name))


def material_value(material: Material) -> str | dict[str, Any]:
    """A material for the properties of a file: its name where it is built in, else its values."""
    return material.name if BUILT_IN.get(material.name) == material else material.as_dict()


def checked(materials: Sequence[str | Material | None], count: int) -> tuple[Material | None, ...]:
    """One material or None for each of ``count`` objects; nothing at all where none has one."""
    found = tuple(None if one is None else Material.of(one) for one in materials)
    if not any(found):
        return ()
    if len(found) != count:
        raise WorldError(f"{len(found)} materials for {count} objects: expected one for each")
    check_unique("materials", [material.name for material in set(found) if material is not None])
    return found
