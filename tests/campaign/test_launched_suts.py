"""Systems under test from launch files: sections, layers, choices, and files of others."""

import json

import pytest

from daemon.campaign import LayerLibrary, LayerReference, RefusedSutError
from grammars.text import codec
from grammars.text.diagnostics import InputError, Severity, Where
from tests.campaign.loaded import write_sut
from tests.parts import ROOT

MOVE_BASE = """\
<launch>
  <arg name="speed" default="0.5"/>
  <arg name="model" default="$(env MODEL)"/>
  <node pkg="move_base" type="move_base" name="move_base_node">
    <param name="base_local_planner" value="dwa_local_planner/DWAPlannerROS"/>
    <rosparam file="$(find nav)/config/$(arg model).yaml" ns="global_costmap"/>
    <rosparam file="$(find nav)/config/$(arg model).yaml" ns="local_costmap"/>
    <rosparam>
      global_costmap: {global_frame: map, static_map: true}
      local_costmap: {global_frame: odom, rolling_window: true}
    </rosparam>
    <param name="DWAPlannerROS/max_vel_trans" value="$(arg speed)"/>
    <param name="DWAPlannerROS/min_vel_trans" value="0.1"/>
    <remap from="scan" to="front/scan"/>
  </node>
</launch>
"""
AMCL = """\
<launch>
  <node pkg="map_server" type="map_server" name="map_server" args="a.yaml"/>
  <node pkg="amcl" type="amcl" name="amcl">
    <param name="odom_alpha1" value="0.1"/>
    <remap from="scan" to="front/scan"/>
  </node>
</launch>
"""
COMMON = """\
footprint: [[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]
observation_sources: scan
scan: {data_type: LaserScan, topic: scan, marking: true, clearing: true}
"""
SUT = "kind: ros\nros:\n  launch: [nav/launch/move_base.launch, nav/launch/amcl.launch]\n"


@pytest.fixture
def folder(tmp_path):
    for name, text in {
        "package.xml": "<package><name>nav</name></package>",
        "launch/move_base.launch": MOVE_BASE,
        "launch/amcl.launch": AMCL,
        "config/burger.yaml": COMMON,
        "config/waffle.yaml": COMMON.replace("0.3", "0.4"),
    }.items():
        path = tmp_path / "nav" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


def write_robot(folder, end="  args: {model: burger}\n", **launch_files):
    """Write a robot with other launch files; ``end`` is the end of its file."""
    for name, text in launch_files.items():
        (folder / "nav" / "launch" / f"{name}.launch").write_text(text)
    write_sut(folder, "robot", SUT + end)


def load(folder, name="robot"):
    library = LayerLibrary(folder)
    library.sut(LayerReference(name, {}, Where("campaign.yaml", 1, 1)))
    return library.sut_file(folder / f"{name}.yaml")


def tree(folder, name="robot"):
    return load(folder, name).reference.parameters


def messages(folder, name="robot"):
    """Return the errors of a file, or its warnings if it has none."""
    try:
        found = load(folder, name).warnings
        assert all(one.severity is Severity.WARNING for one in found)
    except InputError as error:
        found = error.findings
    return [str(one).replace(f"{folder}/", "") for one in found]


def test_launch_files_become_sections_with_names_and_places(folder):
    write_robot(folder, "  env: {MODEL: burger}\n")
    found = load(folder)
    parameters = found.reference.parameters
    assert parameters["amcl"] == {"odom_alpha1": 0.1}
    assert parameters["move_base"]["DWAPlannerROS"] == {"max_vel_trans": 0.5, "min_vel_trans": 0.1}
    assert parameters["move_base"]["local_costmap"]["scan"]["topic"] == "scan"
    assert parameters["topics"] == {
        "maps": ["/map"],
        "nodes": {
            "amcl": {"name": "/amcl", "remap": {"/scan": "/front/scan"}},
            "move_base": {"name": "/move_base_node", "remap": {"/scan": "/front/scan"}},
        },
    }
    places = {
        "/".join(path): str(one.where).replace(f"{folder}/", "")
        for path, one in found.settings.items()
    }
    assert places["move_base/global_costmap/scan/topic"] == "nav/config/burger.yaml:3:37"
    assert places["move_base/global_costmap/static_map"] == "nav/launch/move_base.launch:9:55"
    assert places["amcl/odom_alpha1"] == "nav/launch/amcl.launch:4:38"
    assert places["topics/nodes/amcl/remap//scan"] == "nav/launch/amcl.launch:5:5"


def test_files_and_parameters_go_on_top(folder):
    (folder / "mine.yaml.txt").write_text("odom_alpha1: 0.7\nodom_alpha2: 0.7\n")
    text = (
        "  args: {model: burger}\nfiles: {amcl: mine.yaml.txt}\n"
        "parameters: {amcl: {odom_alpha2: 0.9}, costmap_common: {inflation_radius: 0.7,\n"
        "  scan: {topic: other, marking: null}, static_map: null}}\n"
    )
    write_robot(folder, text)
    parameters = tree(folder)
    for costmap in ("global_costmap", "local_costmap"):
        found = parameters["move_base"][costmap]
        assert found["scan"] == {"data_type": "LaserScan", "topic": "other", "clearing": True}
        assert "static_map" not in found
    assert parameters["amcl"] == {"odom_alpha1": 0.7, "odom_alpha2": 0.9}
    assert parameters["move_base"]["local_costmap"]["inflation_radius"] == 0.7


def test_a_system_like_another_reads_its_launch_files_with_other_args(folder):
    end = "  args: {model: burger, speed: 0.4}\nparameters: {amcl: {kld_err: 0.01}}\n"
    write_robot(folder, end)
    write_sut(folder, "big", "like: robot\nros: {args: {model: waffle}}\n")
    write_sut(folder, "fast", "like: big\nros: {args: {speed: 0.9}}\n")
    write_sut(folder, "none", "like: fast\nparameters: {amcl: {odom_alpha1: null}}\n")
    parameters = tree(folder, "fast")
    assert parameters["move_base"]["local_costmap"]["footprint"][0] == [0.4, 0.2]
    assert parameters["move_base"]["DWAPlannerROS"]["max_vel_trans"] == 0.9
    assert parameters["amcl"] == {"odom_alpha1": 0.1, "kld_err": 0.01}
    assert tree(folder, "big")["move_base"]["DWAPlannerROS"]["max_vel_trans"] == 0.4
    assert tree(folder, "none")["amcl"] == {"kld_err": 0.01}
    write_sut(folder, "wrong", "like: big\nros: {args: {sped: 0.9}}\n")
    (message,) = messages(folder, "wrong")
    assert message.startswith("wrong.yaml:3:14: no launch file named here has an arg sped")
    assert 'did you mean "speed"?' in message


def test_nodes_of_launch_files_without_move_base_or_amcl_are_named(folder):
    flex = '<node pkg="mbf_costmap_nav" type="mbf_costmap_nav" name="mbf"/></launch>'
    (folder / "nav" / "launch" / "flex.launch").write_text(f"<launch>{flex}")
    names = "nav/launch/amcl.launch, nav/launch/flex.launch"
    write_sut(folder, "robot", f"kind: ros\nros: {{launch: [{names}]}}\n")
    (message,) = messages(folder)
    assert message.startswith("robot.yaml:3:7: starts no move_base; it starts /map_server")
    assert "/mbf is Move Base Flex" in message
    gmapping = '<node pkg="gmapping" type="slam_gmapping" name="slam"/></launch>'
    path = folder / "nav" / "launch" / "move_base.launch"
    path.write_text(MOVE_BASE.replace("</launch>", gmapping))
    alone = SUT.replace(", nav/launch/amcl.launch", "")
    write_sut(folder, "robot", f"{alone}  args: {{model: burger}}\n")
    (message,) = (one for one in messages(folder) if "starts no amcl" in one)
    assert "/slam (gmapping) maps while it drives" in message
    assert "amcl" not in tree(folder)


def test_a_value_that_launch_files_cannot_fill_in_may_be_written(folder):
    write_robot(folder, amcl=AMCL.replace('value="0.1"', 'command="rosparam get /x"'))
    assert "odom_alpha1: is what a command prints" in messages(folder)[0]
    write_sut(folder, "mine", "like: robot\nparameters: {amcl: {odom_alpha1: 0.3}}\n")
    assert tree(folder, "mine")["amcl"] == {"odom_alpha1": 0.3}


def test_of_several_robots_one_is_chosen_by_the_name_of_its_move_base(folder):
    groups = "".join(
        f'<group ns="r{i}"><include file="$(find nav)/launch/move_base.launch">'
        f'<arg name="model" value="burger"/><arg name="speed" value="0.{i}"/></include>'
        '<include file="$(find nav)/launch/amcl.launch"/></group>'
        for i in (3, 4)
    )
    (folder / "nav" / "launch" / "two.launch").write_text(f"<launch>{groups}</launch>")
    text = "kind: ros\nros:\n  launch: nav/launch/two.launch\n"
    write_sut(folder, "robot", text)
    (message,) = messages(folder)
    assert "starts 2 move_base nodes: /r3/move_base_node (move_base.launch:4), /r4/" in message
    assert 'write "node: /r3/move_base_node" for that one' in message
    write_sut(folder, "second", f"{text}  node: r4/move_base_node\n")
    parameters = tree(folder, "second")
    assert parameters["move_base"]["DWAPlannerROS"]["max_vel_trans"] == 0.4
    assert parameters["topics"]["nodes"]["amcl"]["name"] == "/r4/amcl"
    assert parameters["topics"]["maps"] == ["/r3/map", "/r4/map"]


def test_only_servers_of_the_map_that_amcl_hears_have_the_map_of_a_run(folder):
    servers = "".join(
        f'<node pkg="map_server" type="map_server" name="s{i}" args="{file}">'
        f'<remap from="map" to="{topic}"/></node>'
        for i, (file, topic) in enumerate([("keep_out.yaml", "walls"), ("a.yaml", "again")])
    )
    write_robot(folder, amcl=AMCL.replace("</launch>", f"{servers}</launch>"))
    assert tree(folder)["topics"]["maps"] == ["/map", "/again"]


def test_footprints_are_found_in_the_namespaces_above_move_base(folder):
    (folder / "nav" / "config" / "burger.yaml").write_text(
        "\n".join(COMMON.splitlines()[1:]) + "\n"
    )
    above = '<rosparam param="/footprint">[[1, 1], [1, -1], [-1, -1], [-1, 1]]</rosparam></launch>'
    write_robot(folder, move_base=MOVE_BASE.replace("</launch>", above))
    assert tree(folder)["move_base"]["footprint"][0] == [1, 1]


@pytest.mark.parametrize(
    ("key", "name"), [("files", "amcl"), ("files", "params"), ("files", "/"), ("ros", "")]
)
def test_parameter_files_of_nav2_are_refused_with_what_can_be_done(folder, key, name):
    (folder / "params").mkdir()
    (folder / "params" / "amcl.yaml").write_text(
        "amcl:\n  ros__parameters:\n    alpha1: 0.2\n"
        "bt_navigator:\n  ros__parameters: {a: 1}\n"
        "local_costmap:\n  local_costmap:\n    ros__parameters: {a: 1}\n"
    )
    said = "ros: params" if key == "ros" else f"files: {{{name}: params/amcl.yaml}}"
    write_sut(folder, "robot", f"kind: ros\n{said}\n")
    (message,) = messages(folder)
    assert message.startswith("params/amcl.yaml:3:5: is a parameter file of ROS 2")
    nothing = "nothing here corresponds to bt_navigator"
    for part in ("kind: ros2", "odom_alpha1 for alpha1", "move_base/local_costmap", nothing):
        assert part in message


def test_a_file_of_nav2_in_a_folder_is_recognised(folder):
    (folder / "params").mkdir()
    (folder / "params" / "nav2.yaml").write_text("amcl:\n  ros__parameters:\n    alpha1: 0.2\n")
    write_sut(folder, "robot", "kind: ros\nros: params\n")
    (message,) = messages(folder)
    assert 'nav2.yaml is for ROS 2: test Nav2 by "kind: ros2"' in message


def test_the_guide_names_every_key():
    text = (ROOT / "docs" / "campaigns.md").read_text()
    section = text.partition("## A ROS 1 configuration")[2].partition("\n## ")[0]
    schema = json.loads((ROOT / "grammars/editor/schemas/sut.schema.json").read_text())
    keys = schema["$defs"]["rossource"]["properties"]
    assert [key for key in keys if f"\n| `{key}` |" not in section] == []


def test_what_a_refused_configuration_would_be_is_known(folder):
    write_robot(folder, "  args: {model: burger, speed: 0.05}\n")
    with pytest.raises(RefusedSutError) as caught:
        load(folder)
    setting = caught.value.settings["move_base", "DWAPlannerROS", "max_vel_trans"]
    assert setting.value == 0.05


def test_the_same_launch_files_elsewhere_are_the_same_system(folder):
    here = '<param name="map" value="$(dirname)/a.yaml"/><param name="b" value="$(find nav)/b"/>'
    write_robot(folder, move_base=MOVE_BASE.replace("<remap", f"{here}<remap"))
    before = load(folder).reference
    moved = folder / "somewhere" / "else"
    moved.mkdir(parents=True)
    for name in ("nav", "robot.yaml"):
        (folder / name).rename(moved / name)
    after = load(moved, "robot").reference
    assert codec.digest(after) == codec.digest(before)
    assert after.parameters["move_base"]["map"] == "$(find nav)/launch/a.yaml"
