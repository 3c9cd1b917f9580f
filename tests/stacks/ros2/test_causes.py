"""The cause of a failure in what a stack has printed: file, line, node, and what is wrong."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from daemon.stacks.ros2.causes import (
    ALARMS,
    find_cause,
    first_error,
    read_death,
    read_down,
    telling_lines,
)

PARAMETERS = """\
/**:
  ros__parameters:
    use_sim_time: true
controller_server:
  ros__parameters:
    controller_frequency: twenty
    FollowPath:
      plugin: dwb_core/DWBLocalPlanner
local_costmap:
  local_costmap:
    ros__parameters:
      width: 3.5
global_costmap:
  global_costmap:
    ros__parameters:
      width: 3
bt_navigator:
  ros__parameters:
    plugin_lib_names:
      - nav2_wait_action_bt_node
      - nav2_dance_action_bt_node
"""


@pytest.fixture
def files(tmp_path):
    path = tmp_path / "5f3a"  # files travel by digest
    path.write_text(PARAMETERS)
    return {"params": str(path)}


def cause(text, files):
    return find_cause(text.splitlines(), files)


def test_a_parameter_of_the_wrong_type(files):
    text = """\
[controller_server-3] [INFO] [17.1] [controller_server]: Configuring controller interface
[controller_server-3] [ERROR] [17.2] []: Original error: parameter 'controller_frequency' has \
invalid type: Wrong parameter type, parameter {controller_frequency} is of type {double}, setting \
it to {string} is not allowed."""
    assert cause(text, files) == (
        'line 6 of the file "params": controller_server needs a double for controller_frequency, '
        'and "twenty" is a string'
    )


def test_a_parameter_is_looked_for_below_its_node(files):
    text = """\
[planner_server-4] [ERROR] [17.2] [global_costmap.global_costmap]: Original error: parameter \
'width' has invalid type: expected [double] got [integer]"""
    assert cause(text, files) == (
        'line 16 of the file "params": global_costmap needs a double for width, and 3 is an integer'
    )


def test_a_parameter_that_no_file_has(files):
    text = """\
[amcl-2] terminate called after throwing an instance of 'rclcpp::exceptions::InvalidParameterType'
[amcl-2]   what():  parameter 'alpha1' has invalid type: Wrong parameter type, parameter {alpha1} \
is of type {double}, setting it to {bool} is not allowed.
[ERROR] [amcl-2]: process has died [pid 7, exit code -6, cmd '/opt/ros/amcl --ros-args']."""
    assert cause(text, files) == "amcl needs a double for alpha1, and a bool was given"


def test_a_plug_in_that_does_not_exist(files):
    text = """\
[controller_server-3] [FATAL] [17.2] [controller_server]: Failed to create controller. Exception: \
According to the loaded plugin descriptions the class dwb_core/DWBLocalPlanner with base class \
type nav2_core::Controller does not exist. Declared types are  dwb_core::DWBLocalPlanner \
nav2_mppi_controller::MPPIController"""
    assert cause(text, files) == (
        'line 8 of the file "params": controller_server finds no plug-in '
        '"dwb_core/DWBLocalPlanner" of type nav2_core::Controller; did you mean '
        '"dwb_core::DWBLocalPlanner"?'
    )


@pytest.mark.parametrize(
    "text",
    [
        "Original error: Could not load library: libnav2_dance_action_bt_node.so: cannot open "
        "shared object file: No such file or directory",
        "Failed to load library /ws/libx.so. Make sure that you are calling the macro. Error "
        "string: Could not load library dlopen error: libnav2_dance_action_bt_node.so: cannot open "
        "shared object file: No such file or directory, at ./src/shared_library.c:99",
    ],
    ids=["behaviour tree", "class loader"],
)
def test_a_library_that_does_not_load(files, text):
    assert cause(f"[bt_navigator-5] [ERROR] [17.2] [bt_navigator]: {text}", files) == (
        'line 21 of the file "params": bt_navigator cannot load the library '
        "libnav2_dance_action_bt_node.so: cannot open shared object file: No such file or directory"
    )


def unreadable(path):
    return f"""\
[smoother_server-2] [ERROR] [17.5] [rcl]: Failed to parse global arguments
[smoother_server-2] terminate called after throwing an instance of 'rclcpp::RCLInvalidROSArgsError'
[smoother_server-2]   what():  failed to initialize rcl: Couldn't parse params file: \
'--params-file {path}'. Error: Cannot have a value before ros__parameters at line 12, at \
./src/parse.c:805, at ./src/rcl/arguments.c:406"""


def test_a_parameter_file_that_a_node_cannot_read(files):
    assert cause(unreadable(files["params"]), files) == (
        'line 12 of the file "params": smoother_server cannot read it: '
        "Cannot have a value before ros__parameters"
    )


def test_a_copy_that_launch_has_made_leads_back_to_the_file(files, tmp_path):
    copy = tmp_path / "launch_params_x"
    copy.write_text("\n" * 11 + PARAMETERS.splitlines()[7] + "\n")
    assert cause(unreadable(copy), files).startswith('line 8 of the file "params": smoother')
    copy.unlink()
    assert cause(unreadable(copy), files).startswith(f"{copy}, line 12: smoother_server cannot")


def test_yaml_that_launch_cannot_read(files):
    text = f"""\
[INFO] [launch]: Default logging verbosity is set to INFO
[ERROR] [launch]: Caught exception in launch (see debug for traceback): while parsing a mapping
  in "{files["params"]}", line 3, column 5
expected <block end>, but found '<block mapping start>'
  in "{files["params"]}", line 4, column 7"""
    assert cause(text, files) == (
        'line 4 of the file "params": launch cannot read it: '
        "expected <block end>, but found '<block mapping start>'"
    )


def test_what_is_known_counts_before_what_came_earlier(files):
    text = """\
[amcl-2] [ERROR] [17.1] [amcl]: Waiting for a map
[bt_navigator-5] [WARN] [17.2] [bt_navigator]: Could not load library: liboptional.so
[bt_navigator-5] [ERROR] [17.2] [bt_navigator]: Could not load library: libx.so: no such file
[controller_server-3]   what():  parameter 'x' has invalid type: expected [double] got [integer]"""
    assert cause(text, files) == "bt_navigator cannot load the library libx.so: no such file"
    assert cause("[amcl-2] [ERROR] [17.1] [amcl]: Waiting for a map", files) == ""


def test_the_first_error_is_not_one_of_its_consequences():
    lines = [
        "[map_server-1] [INFO] [17.0] [map_server]: Configuring",
        "[map_server-1] [ERROR] [17.1] [map_server]: Caught exception in callback for transition 1",
        "[map_server-1] [ERROR] [17.1] [map_server]: Original error: parameter 'yaml_filename' is "
        "not initialized",
        "[lifecycle_manager-7] [ERROR] [17.2] [lifecycle_manager]: Failed to bring up all "
        "requested nodes. Aborting bringup.",
    ]
    expected = "map_server: Original error: parameter 'yaml_filename' is not initialized"
    assert first_error(lines) == expected
    assert first_error([lines[0], *lines[3:]]) == ""
    late = (
        "[lifecycle_manager-7] [ERROR] [1.0] [lifecycle_manager]: Failed to change state for node"
    )
    assert first_error([*lines[3:], f"{late}: amcl"]) == (
        "lifecycle_manager: Failed to change state for node: amcl"
    )
    assert first_error(["[amcl-1]   what():  bad map"]) == "amcl: bad map"


DEATH = (
    "[ERROR] [planner_server-4]: process has died [pid 71, exit code -11, cmd "
    "'/opt/ros/jazzy/lib/nav2_planner/planner_server --ros-args -r __node:=the_planner'].\n"
)


def test_the_death_of_a_process_is_read():
    death = read_death(DEATH)
    assert str(death) == "planner_server died with exit code -11 (SIGSEGV)"
    assert death.is_of(["/ns/planner_server", "/amcl"])
    assert death.is_of(["/the_planner"])
    assert death.is_of([])
    assert not death.is_of(["/amcl"])
    contained = read_death(DEATH.replace("planner_server-4", "component_container_isolated-1"))
    assert contained.is_of(["/amcl"])
    plain = read_death("[ERROR] [rviz2-9]: process has died [pid 71, exit code 1].")
    assert str(plain) == "rviz2 died with exit code 1"
    assert read_death("[ERROR] [amcl-2]: process started with pid [71]") is None


def test_a_missed_heartbeat_names_its_node():
    line = "CRITICAL FAILURE: SERVER amcl IS DOWN after not receiving a heartbeat for 4000 ms."
    assert read_down(line) == "amcl"
    assert read_down(DEATH) == ""


def test_lines_with_errors_come_before_the_last_ones():
    lines = [f"[amcl-2] [INFO] [1.0] [amcl]: {number}" for number in range(100)]
    lines[3] = "[amcl-2] [FATAL] [1.0] [amcl]: no map"
    lines[5] = DEATH
    assert telling_lines(lines) == (lines[3], lines[5], *lines[80:])
    assert telling_lines(lines[:7]) == tuple(lines[:7])


@given(st.lists(st.text() | st.sampled_from([DEATH, *ALARMS, "[a-1] [ERROR] [1.0] []: x"])))
def test_whatever_is_printed_is_read(lines):
    find_cause(lines, {"params": "/nowhere"})
    first_error(lines)
    assert set(telling_lines(lines)) <= set(lines)
