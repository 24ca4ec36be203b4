"""Embree's packets of eight rays, compiled: Embree is called by its address, straight from here.

A packet is RTCRayHit8 of Embree 4: rows of eight numbers, float32 or 32-bit integers. The address
comes in as a number, since a function that knew one by heart could not be kept on disk.
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from lrf3d.compiling import borrower, compiled, inner
from lrf3d.geometry import Float

WIDTH = 8
"""Rays of a packet. Sixteen are no faster where vector registers hold eight float32 numbers."""

X, Y, DX, DY, FAR, MASK, IDS, TRIANGLE, GEOMETRY, INSTANCE = (
    k * WIDTH for k in (0, 1, 4, 5, 8, 9, 10, 17, 18, 19)
)
"""Where the rows of a packet begin that are not left at 0, counted in numbers."""

PACKET = 24 * WIDTH
"""Numbers of a packet: 21 or 22 rows, as Embree was built, and a little room."""

VALID = PACKET
"""Behind the packet: which of its rays are to be cast, −1 or 0 for each."""

ARGUMENTS = VALID + 2 * WIDTH
"""Behind that: RTCIntersectArguments, flags and features first, the rest 0."""

SPACE = ARGUMENTS + 16
"""Numbers of it all."""

ALIGNMENT = 64
"""Bytes to a multiple of which Embree wants packets to lie; 32 would do for eight rays."""

COHERENT = 1 << 16
"""Embree's flag for rays that lie close together: a packet goes down its tree as one."""

SCATTERED = 0
"""The flag for rays that do not: each soon goes its own way."""

LEAST_COMPONENT = 2.0**-40
"""Size of a component of a direction below which Embree gets 0 in its place. It takes the inverse
of less than 1e-18 as that of +1e-18, also of what is negative, and then a packet of beams that all
look level passes by what is before them. So little moves no place by a thousandth of its error."""

ALL = -1
"""All bits: of Embree's features, of the mask of a ray; and as an index, none."""


def _call_address(  # pragma: no cover - Compiling runs it, and kernels are cached.
    typing_context: Any, address: Any, valid: Any, scene: Any, rays: Any, arguments: Any
) -> Any:
    """Call the function at an address as ``void f(void *, void *, void *, void *)``."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        function = ir.FunctionType(ir.VoidType(), [pointer] * 4).as_pointer()
        builder.call(
            builder.inttoptr(values[0], function),
            [builder.inttoptr(value, pointer) for value in values[1:]],
        )
        return context.get_dummy_value()

    return types.void(*[types.intp] * 5), generate


_call: Any = intrinsic(_call_address)


class Packets(NamedTuple):
    """A scene of Embree, and room for the packets that are cast at it.

    Attributes:
        intersect: Address of ``rtcIntersect8``.
        scene: Address of the scene.
        packet: (SPACE,) the packet and its arguments.
    """

    intersect: int
    scene: int
    packet: NDArray[np.int32]


@inner
def packets_for(intersect: int, scene: int, flags: int) -> Packets:
    """Packets, all set in them that is the same for all of a scene.

    The flags are COHERENT or SCATTERED.
    """
    room = np.zeros(SPACE + ALIGNMENT // 4, np.int32)
    start = (-room.ctypes.data % ALIGNMENT) // 4
    packet = room[start : start + SPACE]
    for k in range(WIDTH):
        packet[MASK + k] = packet[INSTANCE + k] = packet[VALID + k] = ALL
    packet[ARGUMENTS], packet[ARGUMENTS + 1] = flags, ALL
    return Packets(intersect, scene, packet)


@borrower
def component(value: float) -> float:
    """A component of a direction as Embree gets it."""
    return value if abs(value) >= LEAST_COMPONENT else 0.0


@borrower
def find(
    packets: Packets,
    x: float,
    y: float,
    dx: Float,
    dy: Float,
    reach: float,
    beams: int,
    faces: NDArray[np.int32],
) -> None:
    """Find the triangle, or −1, that each beam from (x, y) meets first within reach.

    Whole packets are read from dx and dy and written to faces, so these are up to WIDTH − 1
    numbers longer than there are beams.
    """
    packet = packets.packet
    numbers = packet.view(np.float32)
    rays = packet.ctypes.data
    for k in range(WIDTH):
        numbers[X + k], numbers[Y + k] = x, y
        packet[VALID + k] = ALL
    for start in range(0, beams, WIDTH):
        for k in range(WIDTH):
            numbers[DX + k] = component(dx[start + k])
            numbers[DY + k] = component(dy[start + k])
            numbers[FAR + k] = reach
            packet[GEOMETRY + k] = ALL
        for k in range(beams - start, WIDTH):
            packet[VALID + k] = 0
        _call(packets.intersect, rays + 4 * VALID, packets.scene, rays, rays + 4 * ARGUMENTS)
        for k in range(WIDTH):
            faces[start + k] = packet[TRIANGLE + k] if packet[GEOMETRY + k] != ALL else -1


@compiled
def find_faces(
    intersect: int, scene: int, x: float, y: float, dx: Float, dy: Float, reach: float
) -> NDArray[np.int32]:
    """The triangles (beams,) that beams (dx, dy) from (x, y) meet first within reach, or −1."""
    beams = len(dx)
    wide_dx, wide_dy = np.zeros(beams + WIDTH - 1), np.zeros(beams + WIDTH - 1)
    for i in range(beams):
        wide_dx[i], wide_dy[i] = dx[i], dy[i]
    faces = np.empty(beams + WIDTH - 1, np.int32)
    packets = packets_for(intersect, scene, COHERENT)
    find(packets, x, y, wide_dx, wide_dy, reach, beams, faces)
    return faces[:beams]
