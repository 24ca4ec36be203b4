"""Worlds of Gazebo: shapes become walls with heights, and what is not read is counted."""

import numpy as np
import pytest
import shapely
import trimesh

import lrf3d
from lrf3d.base.errors import InputError, Lrf3dNote

BOX = "<box><size>4 2 {}</size></box>"

POSE = "<pose relative_to='{}'>{} {} 0 0 0 0</pose>"

# A model whose link is at (1, 1).
OTHER = f"<model name='o'>{POSE.format('', 1, 1)}<link name='l'/></model>"


def shape(geometry, pose="", kind="collision"):
    return f"<{kind} name='s'>{pose}<geometry>{geometry}</geometry></{kind}>"


def model(*shapes, pose="", name="m", more=""):
    return f"<model name='{name}'>{pose}<link name='l'>{''.join(shapes)}{more}</link></model>"


BOX_SHAPE = shape(BOX.format(2))


def world_of(path, *models):
    file = path / "a.world"
    text = (
        f"<?xml version='1.0'?><sdf version='1.7'><world name='w'>{''.join(models)}</world></sdf>"
    )
    file.write_text(text)
    return lrf3d.load_world(file)


def outline(world, number=0):
    return shapely.convex_hull(shapely.multilinestrings(world.segments.reshape(-1, 2, 2)))


def test_a_box_is_four_exact_walls_as_high_as_its_top(tmp_path):
    pose = "<pose>1 2 0.6 0 0 1.5707963267948966</pose>"
    world = world_of(tmp_path, model(shape(BOX.format(1.2)), pose=pose, name="crate"))
    assert len(world.segments) == 4 and world.heights == pytest.approx([1.2] * 4)
    assert outline(world).bounds == pytest.approx((0, 0, 2, 4), abs=1e-9)
    assert [*world.object_names] == ["crate"]
    low = world_of(tmp_path, model(shape(BOX.format(0.2)), pose="<pose>0 0 0.1 0 0 0</pose>"))
    assert low.heights == pytest.approx([0.2] * 4)


def test_beams_meet_the_walls_where_rays_meet_the_shapes(tmp_path):
    turned = "<pose degrees='true'>3 1 0.5 0 0 30</pose>"
    quaternion = "<pose rotation_format='quat_xyzw'>-4 0 1  0 0 0.5 0.8660254037844386</pose>"
    world = world_of(
        tmp_path,
        model(shape("<cylinder><radius>0.7</radius><length>1</length></cylinder>"), pose=turned),
        model(shape(BOX.format(2), "<pose>0 1 0 0 0 0</pose>"), pose=quaternion),
    )
    assert world.object_count == 2
    matrix = trimesh.transformations.rotation_matrix(np.pi / 3, [0, 0, 1])
    matrix[:3, 3] = [-4, 0, 1]
    matrix[:3, 3] += matrix[:3, :3] @ [0, 1, 0]
    box = trimesh.creation.box((4, 2, 2), transform=matrix)
    lrf = lrf3d.LaserRangeFinder(-np.pi, np.pi * 0.99, 181, range_max=30)
    ranges = lrf3d.PlanarCaster(world).cast(lrf, (0, 0, 0)).ranges
    true = lrf3d.EmbreeCaster(box).cast(lrf, (0, 0, 0)).ranges
    behind = np.cos(lrf.angles) < 0
    assert np.allclose(ranges[behind], true[behind], rtol=1e-5)
    circle = outline(lrf3d.World(world.segments[world.objects == 0]))
    assert circle.area == pytest.approx(np.pi * 0.49, rel=0.01)


ROUND = {
    "<cone><radius>2</radius><length>1</length></cone>": 1.5,
    "<capsule><radius>2</radius><length>1</length></capsule>": 2.0,
    "<ellipsoid><radii>2 2 0.5</radii></ellipsoid>": 3**0.5,
}


@pytest.mark.parametrize("geometry", ROUND)
def test_round_shapes_are_cut_where_the_beams_are(geometry, tmp_path):
    # Their middles are 0.25 m above the beams.
    pose = "<pose>0 0 0.75 0 0 0</pose>"
    world = world_of(tmp_path, model(shape(geometry), pose=pose))
    assert np.abs(outline(world).bounds) == pytest.approx([ROUND[geometry]] * 4, rel=0.01)


def test_what_is_no_xml_but_read_by_gazebo_is_read(tmp_path):
    (tmp_path / "crate").mkdir()
    (tmp_path / "crate" / "model.config").write_text("<model><author>A & B</author></model>")
    box = model(shape(BOX.format(2)))
    (tmp_path / "crate" / "model.sdf").write_text(f"<sdf><!-- gz --levels -->{box}</sdf>")
    (tmp_path / "broken.sdf").write_text("<sdf><model>")
    names = ["crate", "broken.sdf"]
    with pytest.warns(Lrf3dNote, match=r"1 unreadable model \(broken.sdf\)"):
        world = world_of(tmp_path, *(f"<include><uri>{name}</uri></include>" for name in names))
    assert len(world.segments) == 4


@pytest.mark.parametrize(
    "text",
    [
        model(BOX_SHAPE, pose=POSE.format("f", 3, 2))
        + f"<frame name='f'>{POSE.format('', 1, 1)}</frame>",
        model(BOX_SHAPE, pose=POSE.format("f", 3, 2)) + "<frame name='f' attached_to='o'/>" + OTHER,
        model(BOX_SHAPE, pose=POSE.format("o::l", 3, 2)) + OTHER,
        # A chain of many links, and a name that there is none of.
        model(BOX_SHAPE, pose=POSE.format("f40", 3, 3))
        + "".join(f"<frame name='f{n}' attached_to='f{n - 1}'/>" for n in range(2, 41))
        + f"<frame name='f1'>{POSE.format('', 1, 0)}</frame>",
        model(shape(BOX.format(2), POSE.format("gone", 3, 2)), more=POSE.format(" ", 1, 1)),
        # Gazebo Classic saves where it was moved to.
        model(BOX_SHAPE) + f"<state><model name='m'>{POSE.format('', 4, 3)}</model></state>",
        model(
            shape(BOX.format(2), POSE.format("__model__", 4, 3)), more="<pose>7 0 0 0 0 0</pose>"
        ),
        model(
            BOX_SHAPE,
            pose=f"{POSE.format('', 5, 3)}<frame name='a'>{POSE.format('', 1, 0)}</frame>",
        ).replace("'m'", "'m' placement_frame='a'"),
    ],
)
def test_poses_are_relative_to_the_frames_that_they_name(text, tmp_path):
    assert outline(world_of(tmp_path, text)).bounds == pytest.approx((2, 2, 6, 4))


def test_a_polyline_is_the_walls_between_its_points(tmp_path):
    corners = [(0, 0), (3, 0), (3, 1), (1, 0.5), (0, 2)]
    points = "".join(f"<point>{x} {y}</point>" for x, y in corners)
    world = world_of(tmp_path, model(shape(f"<polyline>{points}<height>1.5</height></polyline>")))
    rings = shapely.polygonize(shapely.linestrings(world.segments.reshape(-1, 2, 2)))
    assert rings.geoms[0].equals(shapely.Polygon(corners))
    assert world.heights == pytest.approx([1.5] * 5)


def test_includes_and_meshes_are_found_by_their_folders_and_missing_ones_named(tmp_path):
    folder = tmp_path / "models" / "table"
    folder.mkdir(parents=True)
    trimesh.creation.box((1, 1, 1)).export(folder / "box.stl")
    # A part of a mesh stands where the whole does, unless it is centred.
    part = "<submesh><name>a</name><center>{}</center></submesh></mesh>"
    mesh = "<mesh><uri>model://table/box.stl</uri><scale>2 2 2</scale></mesh>"
    parts = [shape(mesh.replace("</mesh>", part.format(each))) for each in ("false", "true")]
    frame = "<frame name='f'><pose>4 0 0 0 0 0</pose></frame>"
    whole = model(*parts).replace("</model>", f"{frame}</model>")
    (folder / "model.sdf").write_text(f"<sdf version='1.6'>{whole}</sdf>")
    gone = "<mesh><uri>model://gone/a.dae</uri></mesh>"
    plane = "<plane><normal>0 0 1</normal></plane>"
    robot = model(shape(BOX.format(1)), name="robot", more="<sensor name='s' type='ray'/>")
    with pytest.warns(Lrf3dNote) as notes:
        world = world_of(
            tmp_path,
            "<include><uri>model://table</uri><pose>5 0 1 0 0 0</pose></include>",
            "<include><uri>https://web/1.0/x/models/Chair</uri></include>",
            # A model whose frame is placed, and one that was moved.
            "<include><uri>model://table</uri><pose>9 0 0 0 0 0</pose>"
            "<placement_frame>f</placement_frame></include>",
            "<include><uri>model://table</uri><name>t</name><pose>0 0 0 0 0 0</pose></include>"
            "<state><model name='t'><pose>7 0 0 0 0 0</pose></model></state>",
            model(shape(gone), shape(plane), shape(BOX.format(1), "<pose>0 0 9 0 0 0</pose>")),
            robot,
        )
    assert outline(world).bounds == pytest.approx((4, -1, 8, 1)) and world.heights.max() == 2.0
    text = str(notes[0].message)
    for part in ("1 missing model (Chair)", "1 missing mesh file (gone/a.dae)", "1 ground plane",
                 "1 shape of greater height", "1 shape of robots (robot)",
                 "3 parts of a centred mesh"):  # fmt: skip
        assert part in text


def test_a_model_that_includes_itself_ends(tmp_path):
    folder = tmp_path / "loop"
    folder.mkdir()
    inner = "<include><uri>model://loop</uri></include>"
    (folder / "model.sdf").write_text(f"<sdf><model name='m'>{inner}</model></sdf>")
    with pytest.raises(InputError, match="more than 16"):
        world_of(tmp_path, inner)
