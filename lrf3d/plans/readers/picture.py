"""Plans from pictures: walls are what differs from the paper, without doors, letters and floors.

A wall has any colour that is far from the paper's, by a threshold that is found from the picture
(Otsu 1979). Thick areas that are pale or coloured are floors. Two lines close to each other are the
faces of one wall. Where walls are thick, thin strokes are doors, furniture and lettering: small
ones are left out, long ones stay, as thin walls from wall to wall, else as furniture. Small loose
parts are left out, too, but for pillars and chairs that stand alone.
"""

from pathlib import Path
from typing import Any

import numpy as np
import shapely
from PIL import Image, ImageDraw
from scipy.ndimage import binary_erosion, distance_transform_edt, find_objects, label

from lrf3d.base.errors import WorldError
from lrf3d.base.text import Note, counted
from lrf3d.geometry.lines import Bool, Float, Int, directions, lengths, number
from lrf3d.plans.canvas import THICKEST_SOLID, WHITE
from lrf3d.plans.doubts import notes, of_cells, of_dark, of_outside, of_thick
from lrf3d.plans.parts import Parts
from lrf3d.plans.plan import Plan
from lrf3d.plans.rules.enclosure import closed_share, drawn_on, reduced
from lrf3d.plans.rules.left_out import RIM, LeftOut
from lrf3d.plans.rules.pixels import contrast_of, evened, on_paper, pen_of, threshold_of
from lrf3d.plans.rules.sheet import are_bars, is_frame
from lrf3d.world.grid_walls import (
    box_of,
    extent_of,
    grown,
    on_border,
    parts_of,
    sides_of,
    walls_of_grid,
)
from lrf3d.world.model import LARGEST_CELL
from lrf3d.world.pieces import groups, pairs_within
from lrf3d.world.pixels import pixels_of

# Thickness [m] of the thinnest walls in a plan that has thick ones; leaves of doors and outlines of
# furniture are drawn thinner.
THIN = 0.07

# The same [pixels], for coarse pictures.
LEAST = 3

# Distance [m] between parts that belong together: letters of a word, a line and the wall it meets.
CLOSE = 0.1

# Largest size [m] of a leaf and its arc together.
LARGEST_DOOR = 1.4

# Widest window or door [m] that interrupts the walls of a building.
PARTED = 2.5

# Largest size [m] of a letter.
LARGEST_LETTER = 0.6

# The same, as a share of the extent of a plan that is small: that of a model, or on paper.
LETTER_OF_MODEL = 0.2

# Least grey of ink on a transparent sheet, from 0 to 255, that shows on dark paper alone.
LIGHT = 200.0

# Contrast to the paper above which a pixel is pale, and no noise.
PALE_PIXEL = 0.2

# Share of dark pixels in its box from which a part is solid.
SOLID = 0.7

# Length [pixels] below which a piece of a wall is short. In photographs, lettering and patterns
# most of the length is in short pieces; in plans at most half is.
SHORT = 12

# Number of pixels above which a picture is made smaller.
MOST_PIXELS = 12_500_000


def read_picture(
    path: Path, *, resolution: float | None = None, threshold: float | None = None
) -> Plan:
    """Read a picture of a floor plan, from its lower left corner."""
    if resolution is None:
        known = path.with_suffix(".yaml")
        what = "a picture does not say how large it is; give"
        if known.exists():
            raise WorldError(f"{what} {known.name} next to it, or --resolution")
        how = f"--resolution, the metres per pixel, or write {known.name} next to it"
        keys = f"image: {path.name}, resolution: 0.05, origin: [0, 0, 0]"
        raise WorldError(f"{what} {how}: {keys}")
    side = number(resolution, "resolution", positive=True, most=LARGEST_CELL)
    pixels = pixels_of(path)
    # Light ink on a transparent sheet is meant for a dark one.
    inked = pixels[::4, ::4][pixels[::4, ::4, -1] > 0.5 * WHITE]
    few = len(inked) < 0.5 * pixels[::4, ::4, 0].size
    light = few and len(inked) > 0 and inked[:, :-1].mean() > LIGHT
    paper = 0 if light else WHITE
    # Large pictures would need gigabytes as a whole.
    rows = np.array_split(pixels, max(1, len(pixels) // 256))
    colours = np.concatenate([on_paper(each, paper) for each in rows])
    return plan_of_picture(np.broadcast_to(colours, (*colours.shape[:2], 3)), side, threshold)


def plan_of_picture(colours: Any, resolution: float, threshold: float | None) -> Plan:
    """The plan of a picture in colours (rows, columns, 3) from 0 to 255, the first row on top.

    The threshold is the least grey of paper, from 0 to 255; it is found if not given.
    """
    colours, side, coarse = _reduced(colours[::-1], resolution)
    even = evened(colours, 2.0 * THICKEST_SOLID / side)
    light = ""
    if even is not None:
        colours = even
        light = "uneven light is evened, as on a photograph"
    contrast, lightness, key = contrast_of(colours)
    how = ("", "")
    if threshold is None:
        threshold = WHITE * (1.0 - threshold_of(contrast))
        how = (", found from the picture", "--threshold sets it")
    dark = contrast > 1.0 - threshold / WHITE
    pixels = 1.0 / side
    left_out = LeftOut(dark)
    if even is None:
        left_out.leave_pale(*_pale(contrast, dark, pixels))
    stands = left_out.without("coloured part", dark, *_marked(colours, dark))
    # A thick area is a floor if it is pale.
    floors = _floors(stands & (lightness < 0.5), key, pixels)
    drawn = left_out.without("floor", stands, *floors)
    walls, furniture, thin = _cleaned(drawn, pixels, left_out)
    parts = [walls_of_grid(walls), *thin, walls_of_grid(furniture)]
    segments = np.concatenate(parts) * side
    darker = f"darker than grey {threshold:.0f} of {WHITE:.0f}"
    if not len(segments):
        raise WorldError(f"no wall: nothing, or all, is {darker}; `lrf3d edit` draws walls on it")
    balance = left_out.balance(
        walls | furniture | drawn_on(dark.shape, np.concatenate(thin), LEAST)
    )
    doubts = [of_thick(left_out.thick, grown(walls | furniture, RIM))]
    doubts.append(of_dark(1.0 - balance.used / dark.sum()))
    whole = float(np.ptp(segments.reshape(-1, 2), axis=0).prod())
    doubts.append(of_outside(left_out.outside * side**2, whole))
    long = lengths(segments)
    if len(long) > 100 and 2.0 * long[long < SHORT * side].sum() > long.sum():
        doubts = [f"half of their length is in pieces of under {SHORT} pixels: is it a plan?"]
        if light and how[1]:
            held = f"half of the length of what is {darker} is in pieces of under {SHORT} pixels"
            remedy = "cut it to the plan, or choose --threshold and look at `lrf3d world show`"
            raise WorldError(f"a photograph in which no plan is found, as {held}; {remedy}")
    else:
        doubts.append(of_cells(*reduced(walls, pixels, thin[0])))
    left = dark & ~grown(walls | furniture, RIM)
    seen = [
        Parts.of(np.concatenate(parts[:2]) * side, "wall"),
        Parts.of(np.concatenate(parts[2:]) * side, "furniture"),
        Parts.of(walls_of_grid(left) * side, "nothing", rules="dark part"),
    ]
    return Plan(
        seen[0].joined(*seen[1:]),
        removed={"dark part": seen[2].segments},
        left_out=", ".join(counted(n, what) for what, n in left_out.parts.items() if n),
        said=(Note(f"walls are {darker}{how[0]}", how[1]), *notes(coarse, light)),
        doubts=notes(*doubts),
        grey=threshold,
        gap=0.5 * side,
        pen=pen_of(walls, dark) * side,
        balance=balance,
        unit=resolution,
    )


def _pale(contrast: Any, dark: Bool, pixels: float) -> tuple[Bool, int]:
    """The pixels between paper and walls that are as thin as walls, such as windows; their parts.

    Thicker ones are floors.
    """
    pale = (contrast > PALE_PIXEL) & ~dark
    pale &= ~grown(_opened(pale, 0.5 * THICKEST_SOLID * pixels), THICKEST_SOLID * pixels)
    return _large(_opened(pale, _half_thin(pixels)), LARGEST_LETTER * pixels)


def _reduced(colours: Any, side: float) -> tuple[Any, float, str]:
    """A picture that is not too large, by halves, the side of its pixels [m], and a note on it.

    Of four pixels the darkest stays, on dark paper the lightest: thin lines are not lost.
    """
    coarse = ""
    stays = np.minimum if colours[::16, ::16].mean() > 127.0 else np.maximum
    while colours[..., 0].size > MOST_PIXELS:
        rows = stays(colours[:-1:2], colours[1::2])
        colours = stays(rows[:, :-1:2], rows[:, 1::2])
        side = 2.0 * side
        coarse = f"read at {side:g} m a pixel"
    return colours, side, coarse


def _floors(pale: Bool, key: Int, pixels: float) -> tuple[Bool, int]:
    """The pale pixels that are floors: thick areas, and their colours around lettering; parts."""
    floors = _opened(pale, 0.5 * THICKEST_SOLID * pixels)
    _, parts = parts_of(floors)
    if not parts:
        return floors, 0
    usual = np.bincount(key[floors], minlength=1 << 12) > 0.02 * floors.sum()
    return floors | (pale & usual[key] & grown(floors, THICKEST_SOLID * pixels)), parts


def _cleaned(drawn: Bool, pixels: float, left_out: LeftOut) -> tuple[Bool, Bool, list[Float]]:
    """Which pixels are walls and which furniture, and thin walls and sides of furniture (n, 4).

    Args:
        drawn: Which pixels are dark, without floors.
        pixels: Pixels per metre.
        left_out: What is left out, to which this adds.
    """
    drawn = left_out.without("frame part", drawn, *_frame(drawn, pixels))
    drawn = left_out.without("door symbol", drawn, *_doors(drawn, pixels))
    dark = _filled(drawn, pixels)
    solid = _opened(dark, _half_thin(pixels))
    thin = [np.empty((0, 4)), np.empty((0, 4))]
    building = _building(solid, pixels)
    # In a plan of thin lines, thick parts are lettering, or some columns.
    share = extent_of(solid & building) / max(extent_of(dark), 1.0)
    if share > 0.35 and solid[building].sum() > 0.4 * dark[building].sum():
        left_out.thick, _ = _large(solid, LARGEST_DOOR * pixels)
        strokes = dark & ~grown(solid, RIM)
        apart, outside = parts_of((strokes | solid) & ~building)
        left_out.outside = int(sides_of(apart).prod(axis=1).max(initial=0))
        left_out.without("outside part", dark, ~building, outside)
        thin = _thin_walls(strokes & building, solid, pixels, left_out)
        thin = [sides[~_goes_on(sides, building, dark, pixels)] for sides in thin]
        solid &= building
    else:
        solid = dark
    furniture = _loose(solid, drawn, pixels, left_out)
    return solid & ~furniture, furniture, thin


def _large(cells: Bool, least: float) -> tuple[Bool, int]:
    """The cells in parts with a side of a least length [pixels], and the number of these parts."""
    parts, _ = parts_of(cells)
    large = sides_of(parts).max(axis=1) >= least
    return np.asarray(np.append(False, large)[parts]), int(large.sum())


def _marked(colours: Any, dark: Bool) -> tuple[Bool, int]:
    """Coloured parts that touch nothing black or grey, if walls are black or grey; their number."""
    grey = dark & (np.ptp(colours, axis=2) < 64)
    share = grey.sum() / max(dark.sum(), 1)
    if share == 1.0 or share < 0.5 or extent_of(grey) < 0.7 * extent_of(dark):
        return np.zeros_like(dark), 0
    parts, count = parts_of(dark & ~grey)
    loose = np.ones(count + 1, dtype=bool)
    # The rim of a coloured line may be greyish.
    loose[np.unique(parts[grown(_opened(grey, 1.0), 2.0)])] = loose[0] = False
    return grown(loose[parts], RIM), int(loose.sum())


def _frame(drawn: Bool, pixels: float) -> tuple[Bool, int]:
    """The pixels of a sheet's frame and title block, and the number of its parts.

    Other parts are compared by their bounding boxes.
    """
    parts, count = parts_of(drawn)
    if count < 2:
        return np.zeros_like(drawn), 0
    boxes = np.array([(x.start, y.start, x.stop, y.stop) for y, x in find_objects(parts)])
    sides = boxes.reshape(-1, 4)[:, 2:] - boxes.reshape(-1, 4)[:, :2]
    large = (sides > 0.8 * np.ptp(boxes.reshape(-1, 2), axis=0)).all(axis=1)
    if not large.any() or large.all():
        return np.zeros_like(drawn), 0
    lines = [walls_of_grid(parts == part) for part in np.flatnonzero(large) + 1]
    around = np.array([[0, 1, 2, 1], [2, 1, 2, 3], [2, 3, 0, 3], [0, 3, 0, 1]])
    lines += [*boxes[~large][:, around]]
    owner = np.repeat(
        np.append(np.flatnonzero(large), np.flatnonzero(~large)), [len(each) for each in lines]
    )
    # On a sheet, there are thick walls and thin lines.
    thick = _opened(drawn & ~np.append(False, large)[parts], 0.5 * THIN * pixels)
    sheet = extent_of(thick) > 0.3 * extent_of(drawn)
    found = is_frame(np.concatenate(lines) / pixels, sheet)
    framed = np.bincount(owner, found, len(boxes)) > 0.5 * np.bincount(owner, minlength=len(boxes))
    return np.asarray(np.append(False, framed)[parts]), int(framed.sum())


def _doors(drawn: Bool, pixels: float) -> tuple[Bool, int]:
    """The pixels of leaves, arcs and thresholds around quarter discs, in which doors swing.

    Returns the number of doors, too. The space between two thresholds is as long as its door.
    """
    # Fine arcs have gaps.
    parts, count = label(~grown(drawn, 2.0))
    boxes = find_objects(parts)
    sides = sides_of(parts)
    least = sides.min(axis=1)
    most = sides.max(axis=1)
    opened = np.zeros(count + 1, dtype=bool)
    doors = 0
    door = (least > 0.5 * pixels) & (most < LARGEST_DOOR * pixels) & (least > 0.8 * most)
    for place in np.flatnonzero(door):
        own = parts[boxes[place]] == place + 1
        y, x = ((np.arange(side) + 0.5) / side for side in own.shape)
        quarters = [np.hypot(*np.meshgrid(b, a)) < 1.0 for a in (y, 1 - y) for b in (x, 1 - x)]
        # A label may lie in it; beyond the arc, a square shaft goes on.
        if any(own[each].mean() > 0.75 and own[~each].mean() < 0.3 for each in quarters):
            doors += 1
            away = LEAST + 4
            window = tuple(slice(max(s.start - away, 0), s.stop + away) for s in boxes[place])
            near = np.unique(parts[window])
            near = near[near > 0]
            long = most[near - 1] / most[place]
            strip = (least[near - 1] < THICKEST_SOLID * pixels) & (long > 0.85) & (long < 1.15)
            opened[[place + 1, *near[strip]]] = True
    if not doors:
        return np.zeros_like(drawn), 0
    inside = opened[parts]
    reach = max(THIN * pixels, LEAST) + 2.0
    parts, count = label(~drawn)
    walls = _radii(drawn, parts, count) < 0.5 * THICKEST_SOLID * pixels
    walls[np.unique(parts[inside | drawn])] = False
    solid = _opened(drawn, _half_thin(pixels))
    opening = grown(inside, reach) & ~grown(walls[parts], reach) & ~grown(solid, RIM)
    return drawn & opening, doors


def _building(solid: Bool, pixels: float) -> Bool:
    """The cells of the building and next to it, without legends and other separate drawings.

    The building is what the largest connected walls surround, with those that only windows and
    doors separate from them, unless others are as large.
    """
    parts, _ = parts_of(grown(solid, CLOSE * pixels))
    edge = np.argwhere(solid & ~binary_erosion(solid))
    owner = parts[tuple(edge.T)]
    edge = edge[order := np.argsort(owner, kind="stable")]
    owner = owner[order]
    each = np.split(edge[:, ::-1], np.flatnonzero(np.diff(owner)) + 1)
    hulls = shapely.convex_hull(np.array([shapely.multipoints(own) for own in each], dtype=object))
    area = shapely.area(hulls)
    if not area.max(initial=0.0) > 0.0:
        return np.ones_like(solid)
    large = np.flatnonzero(shapely.length(hulls) > 4.0 * LARGEST_LETTER * pixels)
    part = groups(*pairs_within(hulls[large], PARTED * pixels, "parts"), len(large))
    own = np.argmax(area, keepdims=True)
    if len(large):
        own = large[part == part[np.argmax(area[large])]]
    beside = [bar for bar in own if _is_bar(hulls[bar], hulls[own[own != bar]])]
    if beside and _is_aside(solid, np.isin(parts, np.unique(owner)[beside]), pixels):
        own = np.setdiff1d(own, beside)
    main = shapely.convex_hull(shapely.union_all(hulls[own]))
    apart = shapely.disjoint(hulls, main)
    if area[apart].sum() > main.area:
        return np.ones_like(solid)
    kept = shapely.union_all([main, *hulls[area > 0.3 * main.area]]).buffer(0.3 * pixels)
    image = Image.new("1", solid.shape[::-1])
    for shape in shapely.get_parts(kept):
        ImageDraw.Draw(image).polygon(shape.exterior.coords, fill=1)
    return np.asarray(image, dtype=np.bool_)


def _is_bar(hull: Any, others: Any) -> bool:
    """Whether a hull is long and narrow, and outside of what others (n,) surround."""
    if not are_bars(hull):
        return False
    around = shapely.convex_hull(shapely.geometrycollections(others))
    return bool(shapely.disjoint(hull, around))


def _is_aside(solid: Bool, bars: Bool, pixels: float) -> bool:
    """Whether walls close more without some bars: scale bars; a wall between windows closes."""
    whole, rest = (
        closed_share(dark, PARTED * metre)
        for dark, metre in (reduced(each, pixels) for each in (solid, solid & ~bars))
    )
    return rest > whole


def _goes_on(sides: Float, building: Bool, dark: Bool, pixels: float) -> Bool:
    """Which sides (n, 4) [pixels] go on out of the building at both ends: axes and dimensions."""
    found = np.ones(len(sides), dtype=bool)
    ink = grown(dark, 1.0)
    most = np.array(dark.shape)[::-1] - 1
    steps = np.arange(int(np.hypot(*dark.shape)))[:, None]
    for row, (side, along) in enumerate(zip(sides, directions(sides), strict=True)):
        for end, sign in ((side[:2], -1.0), (side[2:], 1.0)):
            line = np.floor(end + sign * steps * along).astype(np.int64)
            line = line[((line >= 0) & (line <= most)).all(axis=1)]
            inside = np.flatnonzero(building[line[:, 1], line[:, 0]])
            beyond = line[inside[-1] + 1 :][: int(0.4 * pixels)] if len(inside) else line[:0]
            found[row] &= len(beyond) > 2 and ink[beyond[:, 1], beyond[:, 0]].mean() > 0.8
    return found


def _thin_walls(strokes: Bool, solid: Bool, pixels: float, left_out: LeftOut) -> list[Float]:
    """Long sides (n, 4) [pixels] of thin strokes, first those from wall to wall."""
    parts, count = parts_of(strokes)
    box = sides_of(parts)
    meets = np.isin(np.arange(1, count + 1), parts[grown(solid, 3.0)])
    # Length [m] from which a side of large strokes stays.
    long = LARGEST_DOOR / 2.0
    large = (box.max(axis=1) > LARGEST_DOOR * pixels) & (meets | (box.min(axis=1) > long * pixels))
    # An isolated line is one of a dimension.
    short = int((~large & (box.max(axis=1) > THIN * pixels)).sum())
    left_out.without("thin stroke", strokes, strokes, short)
    sides = walls_of_grid(np.append(False, large)[parts])
    sides = sides[lengths(sides) >= long * pixels]
    # They end a pixel or two off the walls.
    along = directions(sides)
    sides = sides + 2.5 * np.hstack([-along, along])
    gaps = distance_transform_edt(~solid)
    ends = np.clip(np.floor(sides.reshape(-1, 2)).astype(int), 0, np.array(solid.shape)[::-1] - 1)
    meets = (gaps[ends[:, 1], ends[:, 0]] < CLOSE * pixels).reshape(-1, 2)
    return [sides[meets.all(axis=1)], sides[~meets.all(axis=1)]]


def _loose(solid: Bool, drawn: Bool, pixels: float, left_out: LeftOut) -> Bool:
    """Take small loose parts out of the solid pixels in place; return those that are furniture."""
    parts, count = parts_of(solid)
    sides = sides_of(parts)
    area, inked = (np.bincount(parts[of], minlength=count + 1)[1:] for of in (solid, solid & drawn))
    space = sides.prod(axis=1)
    small = sides.max(axis=1) <= min(LARGEST_LETTER * pixels, 0.04 * extent_of(solid))
    # The letters of a word may touch: the outline of such a part is long.
    edges: Any = sum(
        np.bincount(np.maximum(one, other)[one != other], minlength=count + 1)
        for one, other in ((parts[1:], parts[:-1]), (parts[:, 1:], parts[:, :-1]))
    )
    letter = min(LARGEST_LETTER * pixels, LETTER_OF_MODEL * extent_of(solid))
    small |= (sides.min(axis=1) <= letter) & (edges[1:] > 2.4 * sides.sum(axis=1))
    # Letters stand close to each other, and to the thin strokes of others.
    strokes, _ = parts_of(drawn & ~grown(solid, RIM))
    thin = np.append(False, sides_of(strokes).max(axis=1) <= LARGEST_LETTER * pixels)[strokes]
    words, _ = parts_of(grown(np.append(False, small)[parts] | thin, CLOSE * pixels))
    word = np.zeros(count + 1, dtype=np.int64)
    word[parts[solid]] = words[solid]
    word = word[1:]
    alone = (np.bincount(word, minlength=1)[word] == 1) & ~np.isin(word, words[thin])
    stands = (area >= SOLID * space) & (sides.min(axis=1) >= 0.12 * pixels) & alone
    hollow = (inked < SOLID * area) & (sides.max(axis=1) <= 0.3 * extent_of(solid))
    out = small & ~stands
    solid[:] = left_out.without("small part", solid, np.append(False, out)[parts], int(out.sum()))
    return np.asarray(np.append(False, ~out & hollow)[parts])


def _filled(dark: Bool, pixels: float) -> Bool:
    """The pixels with the space between the two faces of walls."""
    parts, count = label(~dark)
    radius = _radii(dark, parts, count)
    radius[[0, *on_border(parts)]] = np.inf
    narrow = radius <= 0.5 * THICKEST_SOLID * pixels
    rows, columns = (np.flatnonzero(dark.any(axis=axis)) for axis in (1, 0))
    # In a micromouse maze the corridors are as narrow as walls: fill nothing.
    if not len(rows) or narrow[parts].sum() > 0.3 * np.ptp(rows) * np.ptp(columns):
        return dark
    solid = _opened(dark, _half_thin(pixels))
    # The space between a solid wall and a line is not a wall: both of its faces are lines.
    rim = grown(dark, 1.0) & narrow[parts]
    by_solid = np.bincount(parts[rim & grown(solid, RIM)], minlength=count + 1)
    share = by_solid / np.maximum(np.bincount(parts[rim], minlength=count + 1), 1)
    narrow &= (share < 0.2) | (share > 0.8)
    return np.asarray(dark | narrow[parts])


def _half_thin(pixels: float) -> float:
    """Half of the thickness [pixels] of the thinnest walls."""
    return max(0.5 * THIN * pixels, 0.5 * LEAST)


def _opened(cells: Bool, radius: float) -> Bool:
    """Which cells are in a disc of a radius [pixels] of such cells."""
    found = np.zeros_like(cells)
    box = box_of(cells, 1)
    if (own := cells[box]).size:
        core = distance_transform_edt(np.pad(own, 1, mode="edge")) > radius
        found[box] = grown(core, radius)[1:-1, 1:-1] & own
    return found


def _radii(dark: Bool, parts: Any, count: int) -> Float:
    """The largest distance to dark cells in each part; that of the dark one is 0."""
    radius = np.zeros(count + 1)
    np.maximum.at(radius, parts, distance_transform_edt(~dark))
    return radius
