"""Launch files mean what they mean to roslaunch: parameters, namespaces, remaps, args, includes."""

import math

import pytest

from tests.languages.launched import (
    AMCL,
    MOVE_BASE,
    errors,
    launch,
    node,
    package,
    parameters,
    remaps,
    started,
    warnings,
    write,
)


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ('value="3"', 3),
        ('value="3.0"', 3.0),
        ('value="1e3"', "1e3"),
        ('value=" TRUE "', True),
        ('value="1" type="double"', 1.0),
        ('value="3" type="str"', "3"),
        ('value="1" type="bool"', True),
        ('value="False" type="Bool"', False),
        ('value="[1, {a: 2}]" type="yaml"', [1, {"a": 2}]),
        ('value="&lt;a b=&quot;c&quot;&gt;"', '<a b="c">'),
        ('value=""', ""),
    ],
)
def test_a_param_has_the_type_that_roslaunch_gives_it(tmp_path, written, value):
    found = parameters(started(tmp_path, AMCL.format(f'<param name="x" {written}/>')), "/amcl")
    assert found == {"x": value}
    assert type(found["x"]) is type(value)


def test_rosparam_loads_a_file_or_its_own_text_and_merges_mappings(tmp_path):
    (tmp_path / "a.yaml").write_text(
        "scan: {topic: scan, marking: true}\nyaw: !degrees 90\nflip: deg(180)\n"
        "/amcl/outside: 1\nDWAPlannerROS/sim_time: 2.0\n"
    )
    body = MOVE_BASE.format(
        '<rosparam file="$(dirname)/a.yaml" command="load"/>'
        "<rosparam>\n  scan:\n    topic: front  # the other one\n    clearing: yes\n</rosparam>"
        '<rosparam ns="global_costmap" param="plugins">[{name: static, type: S}]</rosparam>'
    )
    loaded = started(tmp_path, body)
    assert parameters(loaded, "/move_base") == {
        "scan/topic": "front", "scan/marking": True, "scan/clearing": True,
        "yaw": pytest.approx(math.pi / 2), "flip": pytest.approx(math.pi),
        "DWAPlannerROS/sim_time": 2.0,
        "global_costmap/plugins": [{"name": "static", "type": "S"}],
    }  # fmt: skip
    assert loaded.parameters["amcl", "outside"].value == 1


def test_every_value_has_the_place_it_was_written_at(tmp_path):
    (tmp_path / "a.yaml").write_text("b:\n  c: 1\n")
    body = MOVE_BASE.format(
        '\n<rosparam file="$(dirname)/a.yaml"/>\n<param name="d"\n   value="2"/>\n'
        "<rosparam>\n  e:\n  <!-- two\n lines -->\n   - f: 3\n</rosparam>"
    )
    found = node(started(tmp_path, body), "/move_base").parameters
    places = {"/".join(path): str(p.where) for path, p in found.items()}
    file = tmp_path / "a.launch"
    assert places == {
        "b/c": f"{tmp_path / 'a.yaml'}:2:6",
        "d": f"{file}:5:11",
        "e": f"{file}:10:4",
    }
    assert str(found["e",].inside[(0, "f")]) == f"{file}:10:9"


def test_of_a_name_the_later_value_holds_but_params_of_a_node_come_last(tmp_path):
    body = (
        '<param name="move_base/a" value="1"/>'
        + MOVE_BASE.format('<param name="b" value="1"/><rosparam>{b: 2, a: 2}</rosparam>')
        + '<rosparam ns="move_base">a: 3</rosparam>'
    )
    assert parameters(started(tmp_path, body), "/move_base") == {"a": 3, "b": 1}


def test_clear_params_and_delete_take_away_what_an_earlier_launch_set(tmp_path):
    one = write(tmp_path, "one.launch", AMCL.format("<rosparam>{a: 1, b: 1}</rosparam>"))
    clear = '<node pkg="amcl" type="amcl" name="amcl" clear_params="true">{}</node>'
    two = write(tmp_path, "two.launch", clear.format("<rosparam>b: 2</rosparam>"))
    gone = write(tmp_path, "gone.launch", AMCL.format('<rosparam command="delete" param="a"/>'))
    assert parameters(launch(one, two), "/amcl") == {"b": 2}
    assert parameters(launch(two, one), "/amcl") == {"a": 1, "b": 1}
    assert parameters(launch(one, gone), "/amcl") == {"b": 1}


def test_a_private_param_of_a_group_is_for_the_nodes_that_follow_in_it(tmp_path):
    second = AMCL.replace('name="amcl"', 'name="other"')
    inside = f'<param name="~x" value="1"/>{AMCL.format("")}'
    loaded = started(tmp_path, f"<group>{inside}</group>{second.format('')}")
    assert parameters(loaded, "/amcl") == {"x": 1}
    assert parameters(loaded, "/other") == {}


def test_names_follow_groups_includes_and_absolute_namespaces(tmp_path):
    write(tmp_path, "b.launch", AMCL.format('<param name="x" value="1"/>'))
    include = '<include file="$(dirname)/b.launch" ns="loc"/>'
    absolute = '<node pkg="amcl" type="amcl" name="top" ns="/"/>'
    loaded = started(tmp_path, f'<group ns="robot1">{include}{absolute}</group>')
    assert [one.name for one in loaded.nodes] == ["/robot1/loc/amcl", "/top"]
    assert parameters(loaded, "/robot1/loc/amcl") == {"x": 1}


def test_remaps_hold_for_what_follows_in_their_scope_and_inner_ones_win(tmp_path):
    before = AMCL.replace('name="amcl"', 'name="before"').format("")
    group = (
        '<group ns="r"><remap from="scan" to="front"/>'
        + AMCL.format('<remap from="map" to="/map"/>')
        + AMCL.replace('name="amcl"', 'name="inner"').format('<remap from="scan" to="~rear"/>')
        + "</group>"
    )
    loaded = started(tmp_path, before + '<remap from="scan" to="/far"/>' + group + AMCL.format(""))
    assert remaps(loaded, "/before") == {}
    assert remaps(loaded, "/r/amcl") == {"/r/scan": "/r/front", "/r/map": "/map"}
    assert remaps(loaded, "/r/inner") == {"/r/scan": "/r/inner/rear"}
    assert remaps(loaded, "/amcl") == {"/scan": "/far"}


def test_arguments_of_a_node_remap_names_and_set_private_parameters(tmp_path):
    arguments = 'args="scan:=base_scan _laser_max_range:=12.0 _tf:=true __log:=/x map.yaml"'
    body = f'<node pkg="amcl" type="amcl" name="amcl" {arguments}/>'
    loaded = started(tmp_path, body)
    assert remaps(loaded, "/amcl") == {"/scan": "/base_scan"}
    assert parameters(loaded, "/amcl") == {"laser_max_range": 12.0, "tf": True}


def test_args_are_passed_as_roslaunch_passes_them(tmp_path):
    write(
        tmp_path,
        "b.launch",
        '<arg name="a" default="1"/><arg name="b"/><arg name="c" default="$(arg a)$(arg b)"/>'
        + AMCL.format('<param name="x" value="$(arg c)" type="str"/>'),
    )
    include = '<include file="$(dirname)/b.launch">{}</include>'
    passed = include.format('<arg name="b" value="$(arg top)"/>')
    loaded = started(tmp_path, f'<arg name="top" default="2"/>{passed}')
    assert parameters(loaded, "/amcl") == {"x": "12"}
    loaded = started(tmp_path, f'<arg name="top" default="2"/>{passed}', args={"top": "7"})
    assert parameters(loaded, "/amcl") == {"x": "17"}
    everything = '<include file="$(dirname)/b.launch" pass_all_args="true"/>'
    loaded = started(tmp_path, f'<arg name="b" value="4"/><arg name="a" value="3"/>{everything}')
    assert parameters(loaded, "/amcl") == {"x": "34"}


def test_if_and_unless_choose_among_tags_of_every_kind(tmp_path):
    body = (
        '<arg name="a" value="x" if="$(arg on)"/><arg name="a" value="y" unless="$(arg on)"/>'
        "<group if=\"$(eval a == 'y')\">"
        + AMCL.format('<param name="p" value="$(arg a)" if="1"/><param name="q" value="1" if="0"/>')
        + "</group>"
    )
    switch = '<arg name="on" default="false"/>'
    assert parameters(started(tmp_path, switch + body), "/amcl") == {"p": "y"}
    assert started(tmp_path, switch + body, args={"on": "true"}).nodes == ()


def test_packages_are_found_by_the_name_they_give_themselves(tmp_path):
    nav = package(tmp_path / "ws" / "src" / "nav_folder", "my_nav")
    (nav / "a.yaml").write_text("x: 1\n")
    load = '<rosparam file="$(find my_nav)/a.yaml"/>'
    loaded = started(tmp_path, AMCL.format(load), packages=(tmp_path / "ws",))
    assert parameters(loaded, "/amcl") == {"x": 1}
    own = write(nav, "launch/b.launch", AMCL.format(load))
    assert parameters(launch(own), "/amcl") == {"x": 1}


def test_a_path_in_a_parameter_does_not_depend_on_where_packages_are(tmp_path):
    nav = package(tmp_path / "nav", "my_nav")
    value = '<param name="x" value="$(find my_nav)/a"/><param name="y" value="$(dirname)/b"/>'
    file = write(nav, "launch/b.launch", AMCL.format(value))
    expected = {"x": "$(find my_nav)/a", "y": "$(find my_nav)/launch/b"}
    assert parameters(launch(file), "/amcl") == expected


def test_subst_value_fills_in_the_file(tmp_path):
    (tmp_path / "a.yaml").write_text("frame: $(arg prefix)odom\nother: $(env ROBOT)\n")
    body = '<arg name="prefix" default="r1/"/>' + AMCL.format(
        '<rosparam file="$(dirname)/a.yaml" subst_value="true"/>'
    )
    found = node(started(tmp_path, body), "/amcl").parameters
    assert found["frame",].value == "r1/odom"
    (missing,) = found["other",].missing
    assert str(missing.where) == f"{tmp_path / 'a.yaml'}:2:1"
    assert parameters(started(tmp_path, body, env={"ROBOT": "x"}), "/amcl")["other"] == "x"
    unfilled = started(tmp_path, body.replace('subst_value="true"', ""))
    assert parameters(unfilled, "/amcl")["frame"] == "$(arg prefix)odom"


def test_what_is_not_known_is_no_error_for_nodes_nobody_asks_about(tmp_path):
    body = (
        '<arg name="bag" default="$(env BAG)"/>'
        '<node pkg="rosbag" type="play" name="play" args="$(arg bag)">'
        '<rosparam file="$(find elsewhere)/a.yaml"/><param name="c" command="rm -rf /"/>'
        '<rosparam file="nowhere.yaml"/><rosparam>[</rosparam></node>'
        '<node pkg="rviz" type="rviz" name="$(anon rviz)"/>'
    )
    loaded = started(tmp_path, body)
    assert [one.name for one in loaded.nodes] == ["/play", "/rviz_anonymous"]
    assert loaded.warnings == ()


def test_commands_and_files_of_params_are_not_read(tmp_path):
    (tmp_path / "secret").write_text("x")
    mark = tmp_path / "mark"
    body = AMCL.format(
        f'<param name="a" command="touch {mark}"/><param name="b" textfile="$(dirname)/secret"/>'
    )
    found = node(started(tmp_path, body), "/amcl").parameters
    assert not mark.exists()
    assert [p.missing[0].message for p in found.values()] == [
        "a: is what a command prints, and commands of launch files are never run",
        "b: is the text of a file, which is not read",
    ]


def test_an_arg_may_be_for_one_of_several_files(tmp_path):
    one = write(tmp_path, "one.launch", '<arg name="a" value="fixed"/>' + AMCL.format(""))
    value = '<param name="x" value="$(arg a)"/>'
    two = write(tmp_path, "two.launch", f'<arg name="a" default="1"/>{MOVE_BASE.format(value)}')
    assert parameters(launch(one, two, args={"a": "7"}), "/move_base") == {"x": 7}


def test_an_include_of_a_package_that_is_not_given_is_left_out(tmp_path):
    include = '<include file="$(find camera)/launch/3d.launch"/>'
    loaded = started(tmp_path, include + AMCL.format(""))
    assert loaded.left_out == ("$(find camera)/launch/3d.launch",)
    assert warnings(started(tmp_path, include, skip=("3d.launch",)), tmp_path) == []


def test_files_are_skipped_by_their_endings(tmp_path):
    body = AMCL.format('<rosparam file="$(env HOME)/.pal/pose.yaml"/>')
    assert parameters(started(tmp_path, body, skip=(".pal/pose.yaml",)), "/amcl") == {}


def test_the_shell_is_not_asked_but_what_it_has_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("MY_ROBOT", "burger")
    body = AMCL.format(
        '<rosparam file="$(env MY_ROBOT)"/><param name="a" value="$(optenv MY_ROBOT no one)"/>'
    )
    (message,) = errors(tmp_path, body)
    assert "in this shell it is MY_ROBOT: burger" in message
    optional = AMCL.format('<param name="a" value="$(optenv MY_ROBOT no one)"/>')
    assert parameters(started(tmp_path, optional), "/amcl") == {"a": "no one"}
    assert parameters(started(tmp_path, optional, env={"MY_ROBOT": "x"}), "/amcl") == {"a": "x"}


@pytest.mark.parametrize(
    "inside",
    [
        '<param name="$(arg a)/b" value="1"/>', '<rosparam ns="$(arg a)">b: 1</rosparam>',
        '<rosparam subst_value="true">$(arg a): 1</rosparam>',
        '<remap from="b" to="$(arg a)/b"/><remap from="$(arg a)/c" to="c"/>',
    ],
)  # fmt: skip
def test_names_in_nodes_of_interest_need_every_variable_once(tmp_path, inside):
    declared = '<arg name="a" default="$(env ROBOT)"/>'
    (message,) = errors(tmp_path, declared + AMCL.format(inside))
    assert "environment variable ROBOT is not given" in message
    other = AMCL.replace("amcl", "other").format(inside)
    assert len(started(tmp_path, declared + AMCL.format("") + other).nodes) == 2


def test_variables_and_packages_among_the_arguments_of_nodes_stay_whole(tmp_path):
    body = '<node pkg="amcl" type="amcl" name="amcl" args="{}"/>'
    loaded = started(tmp_path, body.format("_a:=$(env ROBOT) _b:='$(find maps)/a b'"))
    assert parameters(loaded, "/amcl") == {"a": "$(env ROBOT)", "b": "$(find maps)/a b"}
    assert node(loaded, "/amcl").parameters["a",].missing
    (message,) = errors(tmp_path, body.format("scan:=$(env ROBOT)/scan map:=$(env ROBOT)"))
    assert "environment variable ROBOT is not given" in message


def test_args_that_double_each_other_are_refused(tmp_path):
    doubled = "".join(f'<arg name="a{k + 1}" value="$(arg a{k})$(arg a{k})"/>' for k in range(40))
    messages = errors(tmp_path, f'<arg name="a0" value="lol"/>{doubled}')
    assert "more than 10,000 characters" in messages[0]


def test_a_symbolic_link_that_became_text_is_followed(tmp_path):
    write(tmp_path, "real.launch", AMCL.format('<rosparam file="$(dirname)/link.yaml"/>'))
    (tmp_path / "link.launch").write_text("real.launch\n")
    (tmp_path / "real.yaml").write_text("a: 1\n")
    (tmp_path / "link.yaml").write_text("./real.yaml")
    loaded = started(tmp_path, '<include file="$(dirname)/link.launch"/>')
    assert parameters(loaded, "/amcl") == {"a": 1}
    assert ["real" in one for one in warnings(loaded, tmp_path)] == [True, True]
    (tmp_path / "one.yaml").write_text("two.yaml")
    (tmp_path / "two.yaml").write_text("one.yaml")
    (message,) = errors(tmp_path, AMCL.format('<rosparam file="$(dirname)/one.yaml"/>'))
    assert "one link too many" in message


def test_launch_files_that_include_each_other_again_and_again_end(tmp_path):
    for index in range(20):
        include = f'<include file="$(dirname)/{index + 1}.launch"/>' * 2
        write(tmp_path, f"{index}.launch", include)
    write(tmp_path, "20.launch", "")
    found = errors(tmp_path, '<include file="$(dirname)/0.launch"/>')
    assert "goes on without end" in found[0]


@pytest.mark.parametrize(("name", "text"), [("a.launch.py", ""), ("a.yaml", "x: 1")])
def test_launch_files_of_ros_2_are_named_as_such(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(Exception, match='one of ROS 2 is started by "kind: ros2"'):
        launch(tmp_path / name)


def test_names_no_file_can_have_are_said_where_they_stand(tmp_path):
    (message,) = errors(tmp_path, AMCL.format(f'<rosparam file="{"a" * 5000}"/>'))
    assert message.startswith("a.launch:2:58: ")
    assert "too long" in message


def test_texts_in_other_letters_keep_their_places(tmp_path):
    text = (
        '<?xml version="1.0" encoding="ISO-8859-1"?>\n'
        '<launch><!-- größer -->\n<node pkg="amcl" type="amcl" name="amcl">\n'
        '<param name="ä" value = \'ö\' /><param name="b" value="1"/></node></launch>'
    )
    (tmp_path / "a.launch").write_text(text, encoding="utf-8")
    loaded = launch(tmp_path / "a.launch")
    assert parameters(loaded, "/amcl") == {"ä": "ö", "b": 1}
    assert [p.where.column for p in loaded.nodes[0].parameters.values()] == [26, 54]
