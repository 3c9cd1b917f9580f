"""Walls layers: read, written, and used for scenes with doors, maps, artefacts, campaigns."""

import json

import pytest
import shapely
from shapely.geometry import Polygon

from daemon.campaign import examine, load_campaign
from grammars.jsonld import check_jsonld, load_floorplan_jsonld, scene_document
from grammars.maps import WallsText, load_walls, walls_text
from grammars.model.free_space import FreeSpace
from grammars.model.grid import FREE, OCCUPIED, UNKNOWN
from grammars.model.kinematics import link_poses
from grammars.model.scene import Region, Scene
from grammars.preflight import check_scene
from grammars.scenery import parse_scenery
from grammars.scenery.composition import compile_scene, static_segments
from grammars.text import codec
from grammars.text.diagnostics import InputError
from grammars.text.documents import parse_yaml, read_model
from scenario_tui.library.checking import check_file
from templates.occupancy import occupancy_grid
from templates.tasks import inset_contour

HUT = """\
walls: hut
height: 2.5 m
spaces:
  hall:
    outline: [[0, 0], [6, 0], [6, 4], [0, 4]]
    holes:
      - [[2, 1], [2.5, 1], [2.5, 1.5], [2, 1.5]]
      - [[4, 3], [4.5, 3], [4.5, 3.5], [4, 3.5]]
  kitchen:
    outline: [[6.2, 0], [10, 0], [10, 4], [6.2, 4]]
standing:
  - outline: [[-0.2, -0.2], [10.2, -0.2], [10.2, 4.2], [-0.2, 4.2]]
    holes:
      - [[0, 0], [6, 0], [6, 1], [6.2, 1], [6.2, 0], [10, 0], [10, 4], [6.2, 4], [6.2, 2], [6, 2],
         [6, 4], [0, 4]]
  - {name: post, outline: [[2, 1], [2.5, 1], [2.5, 1.5], [2, 1.5]], height: 1 m}
entryways:
  gap: {from: [6.1, 1], to: [6.1, 2], depth: 20 cm}
"""
"""Two rooms with a gap between them: its way goes up, so the kitchen is to its right."""

DOOR = """
object door
    link post  box 4 cm x 4 cm   at (0 cm, 0 cm)   from 0 m to 1.98 m,    mass 50 kg
    link leaf  box 4 cm x 88 cm  at (0 cm, 47 cm)  from 1 cm to 1.98 m,   mass 15 kg
    joint hinge  revolute from post to leaf at (-2 cm, 2.5 cm), between 0 deg and 90 deg
    state closed: hinge 0 deg
"""


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    path = tmp_path_factory.mktemp("hut") / "hut.walls.yaml"
    path.write_text(HUT)
    return load_walls(path)


@pytest.fixture(scope="module")
def scene(plan):
    return compile_scene(plan)


def test_walls_become_convex_pieces_that_cover_them(plan, scene):
    walls = shapely.union_all([Polygon(f.footprint, f.holes) for f in plan.features])
    pieces = [Polygon(solid.polygon) for solid in scene.solids]
    assert shapely.union_all(pieces).symmetric_difference(walls).area < 1e-6
    assert sum(piece.area for piece in pieces) == pytest.approx(walls.area)
    assert all(piece.convex_hull.area - piece.area < 1e-9 for piece in pieces)
    # Triangles alone would be more.
    assert len(pieces) < 12
    assert {(s.owner, s.kind, s.z_max) for s in scene.solids} == {
        ("wall_1", "wall", 2.5),
        ("post", "wall", 1.0),
    }
    segments, _, owners = static_segments(scene, 0.3)
    assert owners == ("wall_1", "post")
    # Outer face 4, inner face 12, post 4.
    assert len(segments) == 20
    assert check_scene(scene) == ()


def test_holes_count_in_digests_only_where_there_are_some(scene):
    assert "holes" not in codec.to_plain(Region("room", ((0, 0), (1, 0), (1, 1))))
    assert [("holes" in region) for region in codec.to_plain(scene)["regions"]] == [True, False]
    assert codec.from_json(Scene, codec.to_json(scene), exactly=True) == scene


@pytest.mark.parametrize(
    ("words", "y", "tip"),
    [
        # Inwards the kitchen lies; left and right are seen from there, looking at the hall.
        ("hinge left, opening inwards", 1.0, "kitchen"),
        ("hinge right, opening inwards", 2.0, "kitchen"),
        ("hinge left, opening outwards", 1.0, "hall"),
        ("hinge right, opening into hall", 2.0, "hall"),
        ("hinge left, opening into kitchen", 1.0, "kitchen"),
    ],
)
def test_doors_hang_in_gaps(words, y, tip, plan):
    layer = parse_scenery(f"{DOOR}\nfront is a door in gap, {words}", "doors.scenery")
    scene = compile_scene(plan, [layer])
    (door,) = scene.objects
    assert door.doorway == "gap"
    assert door.pose.y == pytest.approx(y, abs=0.06)
    # Open, the leaf lies in the room that it opens to.
    (joint,) = door.joints
    leaf = link_poses(door, (joint.upper or joint.lower,))["leaf"]
    middle, _ = leaf.apply((0.0, 0.47))
    assert (middle > 6.2) if tip == "kitchen" else (middle < 6.0)
    assert [d for d in check_scene(scene) if "starts inside" in d.message] == []


def test_a_space_on_both_sides_of_a_gap_is_no_way_to_open(tmp_path):
    around = [[0, 0], [10, 0], [10, 4], [0, 4]]
    text = f"walls: one\nspaces:\n  office: {{outline: {around}}}\nstanding:\n"
    text += "  - outline: [[5, 0], [5.2, 0], [5.2, 1], [5, 1]]\n"
    text += "  - outline: [[5, 2], [5.2, 2], [5.2, 4], [5, 4]]\n"
    text += "entryways:\n  gap: {from: [5.1, 1], to: [5.1, 2], depth: 20 cm}\n"
    (tmp_path / "one.walls.yaml").write_text(text)
    one = load_walls(tmp_path / "one.walls.yaml")
    sentence = f"{DOOR}\nfront is a door in gap, hinge left, opening into office"
    with pytest.raises(InputError, match="lies on both sides of gap"):
        compile_scene(one, [parse_scenery(sentence, "doors.scenery")])
    inwards = sentence.replace("into office", "inwards")
    assert compile_scene(one, [parse_scenery(inwards, "doors.scenery")]).objects


@pytest.mark.parametrize("rule", ["outline", "touch", "centre"])
def test_holes_are_unknown_on_maps_unless_something_stands_there(rule, scene):
    grid = occupancy_grid(scene, laser_height=0.3, rule=rule)

    def at(x, y):
        row, column = ((v - o) / grid.resolution for v, o in ((y, grid.y), (x, grid.x)))
        return int(grid.cells[int(row), int(column)])

    assert at(1.02, 2.02) == at(8.02, 2.02) == at(6.12, 1.52) == FREE
    assert at(4.22, 3.22) == at(-1.0, 2.0) == UNKNOWN
    assert at(2.22, 1.22) == at(6.12, 3.02) == OCCUPIED


def test_floor_is_counted_without_holes(scene):
    hall = scene.regions[0]
    assert FreeSpace(scene, 1.0).area.area == pytest.approx(24 - 0.5 + 15.2 + 0.2, abs=0.01)
    (around,) = inset_contour(hall, 0.6).parts
    assert (
        min(Polygon(hole).distance(shapely.Point(c)) for hole in hall.holes for c in around) > 0.59
    )


def test_jsonld_reads_back(plan, tmp_path):
    path = tmp_path / "hut.jsonld"
    path.write_text(json.dumps(scene_document(plan)), encoding="utf-8")
    again = load_floorplan_jsonld(path)
    assert again == plan
    assert again.warnings == ()
    assert compile_scene(again).digest == compile_scene(plan).digest
    assert check_jsonld(path) == ()


def test_campaigns_take_a_layer_for_a_floor_plan(demo, campaign):
    (demo / "hut.walls.yaml").write_text(HUT)
    (demo / "front.scenery").write_text(
        f"{DOOR}\nfront is a door in gap, hinge left, opening inwards"
    )
    (demo / "there.mission.yaml").write_text("start: {x: 1, y: 3}\nwaypoints: [{x: 8, y: 2}]")
    slots = {"objects": "front", "behaviours": [], "mission": "there"}

    def write(*plans):
        scenarios = {name: {"like": "calm", "floorplan": plan} | slots for name, plan in plans}
        return campaign(scenarios={"calm": {"abstract": True, "oracles": ["reached"]}} | scenarios)

    path = write(("by-name", "hut"), ("by-file", "hut.walls.yaml"))
    doubts = [d.message for d in examine(path)[1] if "no scenario uses" not in d.message]
    assert doubts == ["scenario by-file is the same as by-name"]
    first, second = load_campaign(path).cells
    assert first.scene.digest == second.scene.digest
    with pytest.raises(InputError, match='did you mean "hut"'):
        load_campaign(write(("wrong", "hat")))
    with pytest.raises(InputError, match=r"hut\.walls\.yaml has no variables"):
        load_campaign(write(("wrong", {"hut": {"width": "1 m"}})))


def test_check_says_what_a_layer_holds(tmp_path):
    (tmp_path / "hut.walls.yaml").write_text(HUT)
    about, found = check_file(tmp_path / "hut.walls.yaml")
    assert (about, found) == ("walls layer with 2 spaces, 2 walls, 1 entryway", ())


def test_a_layer_is_read_and_written(plan, tmp_path, golden):
    text = walls_text(read_model(parse_yaml(HUT, "hut.walls.yaml"), WallsText))
    (tmp_path / "again.walls.yaml").write_text(text, encoding="utf-8")
    assert load_walls(tmp_path / "again.walls.yaml") == plan
    assert (plan.walls, plan.warnings) == ((), ())
    features = [(f.kind, f.id, f.height) for f in plan.features]
    assert features == [("wall", "wall_1", 2.5), ("wall", "post", 1.0)]
    (gap,) = plan.openings
    assert (gap.walls, gap.width, gap.z_min, gap.z_max) == ((), 1.0, 0.0, 2.0)
    # Inwards is to the right of the way from one jamb to the other, where y = 0 is.
    assert gap.frame.x == pytest.approx(6.2)
    corners = {(round(x, 6), round(y, 6)) for x, y in gap.footprint}
    assert corners == {(6.0, 1.0), (6.0, 2.0), (6.2, 1.0), (6.2, 2.0)}
    golden("hut.walls.txt", text)
