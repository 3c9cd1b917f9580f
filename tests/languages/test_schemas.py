"""The published JSON Schemas are those of the models, and agree with them on what people write."""

import functools
import json
import re
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

import grammars.editor
from daemon.campaign import CampaignFile, LayerLibrary, LayerReference
from grammars.maps import load_walls
from grammars.model.mission_files import load_mission
from grammars.model.robot_files import load_robot
from grammars.oracle import load_oracles
from grammars.text.diagnostics import InputError, Where
from grammars.text.documents import load_yaml, parse_yaml, read_model
from scenario_tui.cli.schema import FileKind, schema_of, schema_text

SCHEMAS = Path(grammars.editor.__file__).parent / "schemas"
MODELINE = re.compile(r"# yaml-language-server: \$schema=(\S+)")


@functools.cache
def validator(kind):
    schema = json.loads((SCHEMAS / f"{kind}.schema.json").read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def problems(kind, text):
    """Return where each problem stands, as a path."""
    data = parse_yaml(text, "file.yaml").data
    return [error.json_path for error in validator(SUTS.get(kind, kind)).iter_errors(data)]


@pytest.mark.parametrize("kind", list(FileKind))
def test_the_published_schema_is_that_of_the_models(kind):
    published = (SCHEMAS / kind.file).read_text(encoding="utf-8")
    assert published == schema_text(schema_of(kind)), (
        "the models have changed: scenario schema -o grammars/editor/schemas"
    )


def test_no_schema_is_published_that_nothing_makes():
    assert {p.name for p in SCHEMAS.iterdir()} == {kind.file for kind in FileKind}


def test_every_shipped_file_names_its_schema_and_follows_it(campaigns):
    paths = sorted(campaigns.glob("*/*.yaml"))
    assert len(paths) >= 9
    for path in paths:
        first = path.read_text(encoding="utf-8").partition("\n")[0]
        named = MODELINE.fullmatch(first)
        assert named, f"{path} names no schema in its first line"
        schema = (path.parent / named[1]).resolve()
        assert schema.parent == SCHEMAS.resolve()
        errors = validator(schema.name.partition(".")[0]).iter_errors(load_yaml(path).data)
        assert [f"{path}: {e.json_path}: {e.message}" for e in errors] == []


def test_every_key_is_described():
    for kind in ("campaign", "robot", "sut"):
        schema = validator(kind).schema
        bodies = [schema, *schema["$defs"].values()]
        for body in bodies:
            for key, value in body["properties"].items():
                assert "description" in value or "$ref" in value, (kind, key)
        assert all(body["description"] for body in bodies)


CAMPAIGN = """\
campaign: mine
limit: 3 min
robot: courier
oracles: [navigation]
matrix: {sut: pilot}
map: {resolution: 5 cm, doors: initial}
scenarios:
  one:
    floorplan: flat
    behaviours: [doors_open, doors_face: {near: 1.0 m}]
    mission: courier
    oracles: [reached]
    vary: {floorplan: flats, cover: grid}
  two: {like: one, behaviours+: more, limit: 90 s}
"""
ROBOT = """\
robot: box
footprint: {corners: [[0.3 m, 0.2 m], [-0.3 m, 0.2 m], [0 m, -20 cm]]}
height: 0.3 m
mass: 150 kg
drive: {kind: differential, max_vx: 1 m/s, max_wz: 60 deg/s, max_ax: 1 m/s^2,
        max_az: 2 rad/s^2, max_force: 300 N, max_torque: 100 N m}
laser: {mount: {x: 0.3 m, yaw: -90 deg}, z: 0.3 m, angle_min: -90 deg, angle_max: 90 deg,
        rays: 150, range_min: 0 m, range_max: 5.6 m, rate: 10 Hz, dropout: 5 %}
odometry: {rate: 20 Hz, translation: 0.01 m/m^0.5}
"""
MISSION = """\
mission: round
start: {x: 0, y: 1.5 m}
waypoints:
  - {x: 1.0, y: 2.0, yaw: 90 deg}
  - {id: home, x: 10 cm, y: -2, yaw: 1.57}
"""
SUT = "sut: mine\nkind: pilot\nparameters: {max_speed: 0.4, recoveries: 2}\n"
ORACLES = "near: min(clearance)\nin-time: always(elapsed <= 2 min) when speed > 0.1 m/s\n"
WALLS = """\
walls: hut
height: 2.5 m
spaces:
  hall:
    outline: [[0, 0], [4, 0], [4, 3], [0, 3]]
    holes: [[[1, 1], [1.2, 1], ["1.2 m", 1.2]]]
standing:
  - {name: post, outline: [[1, 1], [1.2, 1], [1.2, 1.2]], height: 1 m}
  - outline: [[4, 0], [4.1, 0], [4.1, 1]]
entryways:
  door: {from: [4.05, 1.1], to: [4.05, 2], depth: 10 cm, height: 2 m}
"""
ROS = """\
sut: mine
kind: ros
ros: params
files: {move_base/global_costmap: common.yaml, move_base: [dwa.yaml, base.yaml]}
parameters:
  amcl: {odom_model_type: omni-corrected, gui_publish_rate: 1.0, anything: 3}
  costmap_common:
    footprint: [[0.3, 0.2], [-0.3, 0.2], [0, -0.2]]
    scan: {topic: scan, marking: true}
  move_base:
    base_local_planner: base_local_planner/TrajectoryPlannerROS
    robot_radius: 0.3
    DWAPlannerROS: {sim_time: 2, controller_frequency: null}
    TrajectoryPlannerROS: {holonomic_robot: false}
    GlobalPlanner: {use_dijkstra: true}
    local_costmap:
      plugins: [{name: seen, type: "costmap_2d::VoxelLayer"}]
      seen: {observation_sources: front, front: {data_type: LaserScan}, z_voxels: 8}
    global_costmap: {static_map: {use_maximum: true}, obstacle_layer: {enabled: false}}
  topics:
    remap: {/a: /b}
    scan: {front: /scan_front, rear: [/scan_rear, /scan]}
    nodes: {amcl: {name: /robot1/amcl, remap: {scan: /a}}}
    maps: [/map]
  quirks: {like: fixed, strafe_leaks: true}
"""
ROS2 = """\
sut: nav2
kind: ros2
launch: ros2 launch my_robot nav.launch.py map:={map}
environment: {setup: /opt/ros/jazzy/setup.bash, ROS_DOMAIN_ID: 7, RMW_IMPLEMENTATION: rmw_x}
container: {image: my/nav2, options: [--gpus, all]}
files: {params: nav.yaml}
topics: {scan: front/scan, odom: null}
ready: amcl
late: 5 %
start-up: 1 min
frames: null
"""
SUTS = {"ros": "sut", "ros2": "sut"}
GOOD = {
    "campaign": CAMPAIGN,
    "robot": ROBOT,
    "mission": MISSION,
    "sut": SUT,
    "oracles": ORACLES,
    "walls": WALLS,
    "ros": ROS,
    "ros2": ROS2,
}
MISTAKES = [
    ("campaign", "limit: 3 min", "limit: 3", "$.limit"),
    ("campaign", "limit: 3 min", "limit: 3 m", "$.limit"),
    ("campaign", "limit: 3 min", "limit: 0 min", "$.limit"),
    ("campaign", "limit: 3 min\n", "", "$"),
    ("campaign", "robot: courier", "robots: courier", "$"),
    ("campaign", "robot: courier", "robot: [courier]", "$.robot"),
    ("campaign", "doors: initial", "doors: some", "$.map.doors"),
    ("campaign", "5 cm", "0.05", "$.map.resolution"),
    ("campaign", "doors: initial", "rule: middle", "$.map.rule"),
    ("campaign", "doors: initial", 'file: ""', "$.map.file"),
    ("campaign", "cover: grid", "cover: halton", "$.scenarios.one.vary"),
    ("campaign", "    mission: courier", "    misson: courier", "$.scenarios.one"),
    ("campaign", "  two:", "  my two:", "$.scenarios"),
    ("campaign", "behaviours+:", "objects+:", "$.scenarios.two"),
    ("robot", "mass: 150 kg", "mass: 150", "$.mass"),
    ("robot", "mass: 150 kg", "mass: -150 kg", "$.mass"),
    ("robot", "max_wz: 60 deg/s", "max_wz: 1 m/s", "$.drive.max_wz"),
    ("robot", "kind: differential", "kind: ackermann", "$.drive.kind"),
    ("robot", "{corners:", "{length: 1 m, corners: [], corner:", "$.footprint"),
    ("robot", "-20 cm", "-20", "$.footprint.corners[2][1]"),
    ("robot", "rays: 150", "rays: 150.5", "$.laser.rays"),
    ("mission", "y: 2.0,", "", "$.waypoints[0]"),
    ("mission", "yaw: 90 deg", "yaw: 90 m", "$.waypoints[0].yaw"),
    ("mission", "id: home", "name: home", "$.waypoints[1]"),
    ("sut", "max_speed: 0.4", "max_speed: 0.4 m/s", "$.parameters.max_speed"),
    ("sut", "max_speed: 0.4", "maxspeed: 0.4", "$.parameters"),
    ("sut", "kind: pilot", "kind: idle", "$.parameters"),
    ("oracles", "min(clearance)", "minimum(clearance)", "$.near"),
    ("oracles", "min(clearance)", "0.3 m", "$.near"),
    ("oracles", "min(clearance)", "3", "$.near"),
    ("oracles", "in-time:", "in time:", "$"),
    ("walls", "height: 2.5 m", "height: 2.5", "$.height"),
    ("walls", "hall:", "grand hall:", "$.spaces"),
    ("walls", "[[1, 1], [1.2, 1], [1.2, 1.2]]", "[[1, 1], [1.2, 1]]", "$.standing[0].outline"),
    ("walls", "depth: 10 cm, ", "", "$.entryways.door"),
    ("walls", "to: [4.05, 2]", "to: [4.05, 2, 0]", "$.entryways.door.to"),
    ("ros", "omni-corrected", "omnidirectional", "$.parameters.amcl.odom_model_type"),
    ("ros", "sim_time: 2", "sim_time: long", "$.parameters.move_base.DWAPlannerROS.sim_time"),
    ("ros", ", [0, -0.2]]", "]", "$.parameters.costmap_common.footprint"),
    ("ros", "marking: true", "marking: 3", "$.parameters.costmap_common.scan.marking"),
    ("ros", "remap: {/a: /b}", "remaps: {}", "$.parameters.topics"),
    ("ros", "use_dijkstra: true", "use_dijkstra: false",
     "$.parameters.move_base.GlobalPlanner.use_dijkstra"),
    ("ros", "enabled: false", "enabled: 2",
     "$.parameters.move_base.global_costmap.obstacle_layer.enabled"),
    ("ros", "[/map]", "/map", "$.parameters.topics.maps"),
    ("ros", "kind: ros\n", "", "$"),
    ("ros2", "start-up: 1 min", "start-up: 60", "$['start-up']"),
    ("ros2", "scan: front/scan", "scann: x", "$.topics"),
    ("ros2", "ROS_DOMAIN_ID: 7", "ROS_DOMAIN_ID: 102", "$.environment"),
    ("ros2", "ready: amcl", "mission: dock", "$.mission"),
    ("ros2", "files: {params: nav.yaml}", "parameters: {a: 1}", "$.parameters"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        *GOOD.items(),
        ("sut", ROS.replace("kind: ros", "like: other")),
        ("sut", ROS2.replace("kind: ros2\n", "like: other\n")),
        ("sut", ROS2.replace("late: 5 %", "late: null")),
        ("sut", "sut: nav\nkind: nav2\nparameters: {anything: [1, 2]}"),
    ],
)
def test_a_sound_file_is_accepted(kind, text):
    assert problems(kind, text) == []


@pytest.mark.parametrize("kind", GOOD.keys() - SUTS.keys())
def test_readers_take_what_schemas_accept(kind, tmp_path):
    read(kind, GOOD[kind], tmp_path)


@pytest.mark.parametrize(("kind", "right", "wrong", "place"), MISTAKES)
def test_a_usual_mistake_is_refused_where_it_stands(kind, right, wrong, place, tmp_path):
    assert right in GOOD[kind]
    text = GOOD[kind].replace(right, wrong, 1)
    found = problems(kind, text)
    assert found == [place] if kind in SUTS else place in found
    with pytest.raises(InputError):
        read(kind, text, tmp_path)


def test_other_kinds_have_no_keys_of_a_ros2_stack():
    assert problems("sut", "sut: a\nkind: pilot\nlaunch: x\n") == ["$.launch"]


READERS = {
    "robot": load_robot,
    "mission": load_mission,
    "oracles": load_oracles,
    "walls": load_walls,
}


def read(kind, text, folder):
    """Read a file as the program does; a campaign without its layers."""
    path = folder / f"mine.{kind}.yaml"
    path.write_text(text, encoding="utf-8")
    if kind == "campaign":
        read_model(load_yaml(path), CampaignFile)
    elif kind in ("sut", *SUTS):
        LayerLibrary(folder).sut(LayerReference(path.name, {}, Where("", 1, 1)))
    else:
        READERS[kind](path)


def _patterns(node):
    if isinstance(node, dict):
        if isinstance(node.get("pattern"), str):
            yield node["pattern"]
        yield from node.get("patternProperties", ())
        node = list(node.values())
    for child in node if isinstance(node, list) else ():
        yield from _patterns(child)


@pytest.mark.parametrize("kind", list(FileKind))
def test_expressions_keep_to_what_javascript_understands(kind):
    for pattern in _patterns(validator(kind.value).schema):
        assert not re.search(r"\(\?[^:=!]|[*+?}]\+|\\[^\w.+*^$?()\[\]{}|/\\]", pattern), pattern
