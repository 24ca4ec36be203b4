"""Pictures of floor plans: what of them is a wall, in any colour and format."""

import numpy as np
import pytest
import shapely
from PIL import Image, ImageDraw, ImageOps
from scipy.ndimage import gaussian_filter

from lrf3d.base.errors import Lrf3dNote, WorldError
from lrf3d.planning.planner import find_route
from lrf3d.world import load_world

SIDE = 0.02
"""Side of a pixel [m]."""

ROOMS = [(0.3, 0.3, 5.0, 3.8), (5.2, 0.3, 9.7, 3.8), (0.3, 4.0, 9.7, 6.7)]
DOORS = [(2.0, 3.8, 2.9, 4.0), (7.0, 3.8, 7.9, 4.0)]
WALLS = shapely.box(0, 0, 10, 7).difference(
    shapely.union_all([shapely.box(*each) for each in (*ROOMS, *DOORS)])
)


class Sheet:
    """A sheet of paper of 12 m by 9 m; places are in metres from the plan's lower left corner."""

    def __init__(self, paper=(255, 255, 255)):
        self.image = Image.new("RGB", (600, 450), paper)
        self.draw = ImageDraw.Draw(self.image)

    @classmethod
    def of_plan(cls, ink=(0, 0, 0), faces=False, paper=(255, 255, 255)):
        """A sheet with the walls of the plan."""
        sheet = cls(paper)
        sheet.walls(ink, faces)
        return sheet

    def at(self, *points):
        return [((x + 1.0) / SIDE, (8.0 - y) / SIDE) for x, y in points]

    def box(self, x1, y1, x2, y2, **how):
        self.draw.rectangle(self.at((x1, y2), (x2, y1)), **how)

    def walls(self, ink=(0, 0, 0), faces=False):
        for ring, fill in ((WALLS.exterior, ink), *((inner, None) for inner in WALLS.interiors)):
            points = self.at(*ring.coords)
            if faces:
                self.draw.line(points, fill=ink, width=2)
            else:
                self.draw.polygon(points, fill=fill or self.image.getpixel((0, 0)))

    def furnish(self, ink=(60, 60, 60)):
        """Door leaves and arcs, a bed, a label and a dimension line, in thin strokes."""
        for x1, y1, x2, _ in DOORS:
            self.draw.line(self.at((x1, y1), (x1, y1 - 0.9)), fill=ink)
            self.draw.arc(
                [*self.at((x1 - 0.9, y1 + 0.9))[0], *self.at((x2, y1 - 0.9))[0]], 0, 90, ink
            )
        self.box(0.5, 0.5, 2.1, 2.5, outline=ink)
        for place in range(6):
            x = 6.0 + 0.16 * place
            self.draw.line(self.at((x, 5.0), (x + 0.08, 5.2), (x + 0.08, 5.0)), fill=ink)
        self.draw.line(self.at((0, -0.5), (10, -0.5)), fill=ink)

    def read(self, folder, name="plan.png", convert=None, **how):
        path = folder / name
        image = self.image if convert is None else convert(self.image)
        image.save(path, **({"quality": 70} if path.suffix == ".jpg" else {}))
        return load_world(path, resolution=SIDE, **how)


@pytest.fixture
def sheet():
    """A sheet with the walls of the plan."""
    return Sheet.of_plan()


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """The world of the walls alone."""
    return Sheet.of_plan().read(tmp_path_factory.mktemp("plain"))


def off(world, high=2.0):
    """How far the high walls of a world and those of the plan are apart [m]."""
    found = world.segments[world.heights > high].reshape(-1, 2, 2) - 1.0
    return shapely.hausdorff_distance(shapely.multilinestrings(found), WALLS.boundary)


@pytest.mark.parametrize(
    ("faces", "ending"), [(False, ".bmp"), (True, ".png"), (False, ".jpg"), (True, ".jpg")]
)
def test_every_room_of_a_furnished_plan_is_reached_and_its_walls_are_as_drawn(
    faces, ending, tmp_path
):
    sheet = Sheet()
    for box, floor in zip(ROOMS, [(232, 232, 232), (250, 225, 190), (225, 240, 250)], strict=True):
        sheet.box(*box, fill=floor)
    sheet.walls(faces=faces)
    sheet.box(*DOORS[0], fill=(232, 232, 232))
    sheet.box(*DOORS[1], fill=(232, 232, 232))
    if faces:
        sheet.walls(faces=True)
    sheet.furnish()
    with pytest.warns(Lrf3dNote, match=r"darker than grey \d+ of 255.*thin stroke"):
        world = sheet.read(tmp_path, f"plan{ending}")
    assert off(world) < 0.06
    furniture = world.segments[world.heights < 2.0]
    assert (world.heights < 2.0).any() and set(world.heights.tolist()) == {2.5, 0.8}
    assert shapely.box(1.4, 1.4, 3.2, 3.6).covers(shapely.multipoints(furniture.reshape(-1, 2)))
    found = find_route(world)
    assert found.notes == () and found.radius == 0.35
    for box in ROOMS:
        inside = shapely.box(*box)
        assert shapely.contains_xy(inside, *(found.waypoints - 1.0).T).any()


@pytest.mark.parametrize(
    ("paper", "ink"),
    [
        ((255, 255, 255), (128, 128, 128)),
        ((255, 255, 255), (220, 30, 30)),
        ((255, 255, 255), (255, 220, 0)),
        ((230, 220, 205), (90, 70, 60)),
        ((20, 40, 110), (240, 240, 255)),
        ((0, 0, 0), (255, 255, 255)),
    ],
)
def test_walls_have_any_colour_on_any_paper(paper, ink, tmp_path):
    assert off(Sheet.of_plan(ink, paper=paper).read(tmp_path)) < 0.06


@pytest.mark.parametrize(
    "convert",
    [
        lambda image: image.convert("L"),
        lambda image: image.convert("P", palette=Image.Palette.ADAPTIVE),
        lambda image: image.convert("1"),
        lambda image: Image.fromarray(np.asarray(image.convert("L")).astype(np.uint16) * 257),
        lambda image: Image.merge(
            "LA", [Image.new("L", image.size), ImageOps.invert(image.convert("L"))]
        ),
    ],
)
def test_kinds_of_pixels_make_no_difference(sheet, convert, plain, tmp_path):
    assert np.array_equal(sheet.read(tmp_path, "other.png", convert).segments, plain.segments)


def test_the_threshold_is_found_or_given(sheet, tmp_path):
    sheet.box(6.0, 1.0, 7.5, 1.4, fill=(170, 170, 170))
    with pytest.warns(Lrf3dNote, match="found from the picture; --threshold"):
        plain = sheet.read(tmp_path)
    assert len(sheet.read(tmp_path, threshold=200).segments) == len(plain.segments) + 4
    with pytest.raises(WorldError, match=r"darker than grey 128 of 255; .lrf3d edit"):
        Sheet().read(tmp_path, "empty.png")


def test_small_loose_parts_are_not_walls_but_pillars_are(sheet, tmp_path):
    sheet.box(5.0, 5.0, 5.3, 5.3, fill=(0, 0, 0))
    for x in (1.0, 1.2, 1.4, 1.6):
        sheet.box(x, 5.0, x + 0.1, 5.2, fill=(0, 0, 0))
    world = sheet.read(tmp_path)
    inner = world.segments[(np.abs(world.segments[:, ::2] - 6.0) < 4.0).all(axis=1)]
    pillar = inner[(np.abs(inner[:, 1::2] - 6.15) < 0.4).all(axis=1)]
    assert len(pillar) == 4 and pillar[:, ::2].min() > 5.9


@pytest.mark.parametrize("paper", [0, 255])
def test_a_very_large_picture_is_read_coarser_and_keeps_its_lines(paper, tmp_path, monkeypatch):
    monkeypatch.setattr("lrf3d.plans.readers.picture.MOST_PIXELS", 1 << 17)
    sheet = Sheet((paper, paper, paper))
    sheet.draw.line(sheet.at((0, 0), (9, 0), (9, 6)), fill=(255 - paper,) * 3)
    with pytest.warns(Lrf3dNote, match=r"read at 0\.04 m a pixel"):
        world = sheet.read(tmp_path)
    assert len(world.segments) == 2
    assert world.bounds == pytest.approx(np.array([[1, 1], [10, 7]]), abs=0.06)


def test_a_maze_of_centimetres_is_not_hatching(tmp_path):
    sheet = Sheet()
    for x in range(10):
        sheet.draw.line(
            sheet.at((x, 0), (x, 6.5)) if x % 2 else sheet.at((x, 0.5), (x, 7)), width=3, fill=0
        )
    sheet.box(-0.5, -0.5, 9.5, 7.5, outline=(0, 0, 0), width=3)
    (folder := tmp_path / "m").mkdir()
    sheet.image.save(folder / "maze.png")
    small = load_world(folder / "maze.png", resolution=0.004)
    assert len(small.segments) >= 10 * 4


def test_parts_of_a_sheet_next_to_a_plan_are_not_walls(sheet, plain, tmp_path):
    sheet.image = ImageOps.expand(sheet.image, 150, (255, 255, 255))
    sheet.draw = ImageDraw.Draw(sheet.image)

    def line(*points, ink=(0, 0, 0)):
        places = [(150 + x, 150 + y) for x, y in sheet.at(*points)]
        sheet.draw.line(places, fill=ink, width=1 + (ink != (0, 0, 0)))

    # A frame with a title block, an axis through a room, a legend, and a way in green.
    line((-3, -3), (12.5, -3), (12.5, 10), (-3, 10), (-3, -3))
    line((8, -3), (8, -2), (12.5, -2))
    line((7.0, -1.5), (7.0, 9))
    line((11, 1), (12, 1), (12, 3), (11, 3), (11, 1))
    line((1, 1), (2, 2), (4, 2), ink=(0, 160, 60))
    with pytest.warns(Lrf3dNote, match=r"coloured part.*frame part.*outside part"):
        world = sheet.read(tmp_path)
    assert world.segments - 150 * SIDE == pytest.approx(plain.segments, abs=1.1 * SIDE)


def test_swatches_of_a_legend_next_to_a_plan_are_not_walls(sheet, plain, tmp_path):
    sheet.image = ImageOps.expand(sheet.image, (0, 0, 150, 0), (255, 255, 255))
    sheet.draw = ImageDraw.Draw(sheet.image)
    for y in range(4):
        sheet.box(12.8, 1.4 * y, 13.8, 1.4 * y + 1, fill=(0, 0, 0))
    with pytest.warns(Lrf3dNote, match="4 outside parts"):
        world = sheet.read(tmp_path)
    assert np.array_equal(world.segments, plain.segments)


@pytest.mark.parametrize("faces", [False, True])
def test_a_door_with_thresholds_stands_open_where_its_leaf_and_arc_are_drawn(faces, tmp_path):
    sheet = Sheet.of_plan(faces=faces)
    for x1, y1, x2, y2 in DOORS:
        for y in (y1, y2):
            sheet.draw.line(sheet.at((x1, y), (x2, y)), fill=0)
    sheet.furnish()
    with pytest.warns(Lrf3dNote, match="2 door symbols"):
        world = sheet.read(tmp_path)
    assert off(world) < 0.06 and find_route(world).notes == ()


@pytest.mark.parametrize(("begin", "walls"), [(-0.9, 0), (3.9, 1)])
def test_an_axis_adds_no_wall_but_a_thin_wall_that_goes_on_at_one_end_is_one(
    begin, walls, sheet, plain, tmp_path
):
    sheet.draw.line(sheet.at((4.6, begin), (4.6, 7.9)), fill=0)
    found = sheet.read(tmp_path).segments
    assert len(found) == len(plain.segments) + walls
    assert walls or np.array_equal(found, plain.segments)


def test_a_scale_bar_under_a_plan_is_not_a_wall(sheet, tmp_path):
    sheet.box(1, -0.8, 6, -0.6, fill=(0, 0, 0))
    assert off(sheet.read(tmp_path)) < 0.06


def test_uneven_light_on_a_photograph_is_evened(tmp_path):
    sheet = Sheet.of_plan((110, 105, 100), paper=(240, 238, 230))

    def photographed(image):
        y, x = np.mgrid[0 : 1 : image.height * 1j, 0 : 1 : image.width * 1j]
        noise = np.random.default_rng(0).normal(0.0, 3.0, (*x.shape, 1))
        light = (1.0 - 0.4 * x - 0.2 * y)[..., None]
        return Image.fromarray((np.asarray(image) * light + noise).clip(0, 255).astype(np.uint8))

    with pytest.warns(Lrf3dNote, match="uneven light is evened"):
        world = sheet.read(tmp_path, "photo.jpg", photographed)
    assert off(world) < 0.06


def test_a_photograph_without_a_plan_is_refused_and_lettering_is_doubted(tmp_path):
    rng = np.random.default_rng(1)
    clouds = gaussian_filter(rng.normal(0.0, 1.0, (300, 400)), 4.0)
    photo = Image.fromarray(np.uint8(np.clip(127.0 + 700.0 * clouds, 0, 255)))
    photo.save(tmp_path / "clouds.jpg")
    with pytest.raises(WorldError, match=r"in which no plan.*--threshold.*lrf3d world show"):
        load_world(tmp_path / "clouds.jpg", resolution=SIDE)
    dots = np.repeat(np.repeat(rng.random((40, 60)) < 0.5, 6, axis=0), 6, axis=1)
    Image.fromarray(dots).save(tmp_path / "dots.png")
    with pytest.warns(Lrf3dNote, match=r"is it a plan\?.*--threshold.*lrf3d edit"):
        load_world(tmp_path / "dots.png", resolution=SIDE)


def test_a_square_shaft_with_a_label_in_its_corner_is_not_a_door(tmp_path):
    sheet = Sheet.of_plan(faces=True)
    sheet.box(3.8, 0.3, 5.0, 1.5, outline=(0, 0, 0), width=2)
    plain = sheet.read(tmp_path)
    sheet.draw.line(sheet.at((4.7, 0.6), (4.7, 0.9), (4.85, 0.6), (4.85, 0.9)), fill=0)
    with pytest.warns(Lrf3dNote) as notes:
        labelled = sheet.read(tmp_path)
    assert not any("door symbol" in str(note.message) for note in notes)
    assert labelled.bounds == pytest.approx(plain.bounds)


def test_round_letters_are_not_columns(sheet, tmp_path):
    sheet.box(8.0, 5.0, 8.3, 5.3, fill=0)
    plain = sheet.read(tmp_path)
    ring = sheet.at((4.0, 5.2), (4.22, 4.98))
    sheet.draw.ellipse([*ring[0], *ring[1]], outline=0, width=1)
    for x in (4.22, 4.32, 4.42):
        sheet.draw.line(sheet.at((x, 5.4), (x, 4.98)), fill=0)
    with pytest.warns(Lrf3dNote, match="1 small part"):
        assert np.array_equal(sheet.read(tmp_path).segments, plain.segments)


def test_a_picture_that_closes_no_room_is_doubted_unless_it_is_a_town_or_an_open_room(tmp_path):
    def doubted(sheet, name):
        with pytest.warns(Lrf3dNote) as notes:
            sheet.read(tmp_path, f"{name}.png")
        return any("closes a room: is it a plan?" in str(note.message) for note in notes)

    words, star, blocks, room = (Sheet() for _ in range(4))
    words.draw.text((20, 120), "HELLO", fill=0, font_size=180)
    turn = np.arange(10) * 0.2 * np.pi
    reach = np.where(np.arange(10) % 2, 1.2, 3.0)
    corners = np.column_stack([4 + reach * np.cos(turn), 4 + reach * np.sin(turn)])
    star.draw.polygon(star.at(*corners), fill=0)
    for x in range(5):
        for y in range(4):
            blocks.box(2 * x, 2 * y, 2 * x + 1, 2 * y + 1, fill=0)
    room.draw.line(room.at((4, 0), (0, 0), (0, 6), (9, 6), (9, 0), (8, 0)), fill=0, width=3)
    plan = Sheet.of_plan()
    assert doubted(words, "words") and doubted(star, "star")
    assert not (doubted(blocks, "blocks") or doubted(room, "room") or doubted(plan, "plan"))


def test_rooms_with_specks_are_not_walls(tmp_path):
    sheet = Sheet.of_plan(faces=True)
    sheet.furnish()
    for x in np.arange(0.5, 9.6, 0.66):
        for y in np.arange(0.5, 6.6, 0.66):
            sheet.draw.rectangle([*sheet.at((x, y))[0], *sheet.at((x + 0.03, y - 0.03))[0]], fill=0)
    world = sheet.read(tmp_path)
    assert off(world) < 0.06 and find_route(world).notes == ()
