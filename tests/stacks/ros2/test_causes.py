"""The cause of a failure in what a stack has printed: file, line, node, and what is wrong."""

from pathlib import Path

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
from tests.stacks.cases import cases, written

CAUSES = Path(__file__).with_name("causes.txt")
PARAMETERS = CAUSES.with_name("parameters.yaml").read_text("utf-8")


@pytest.fixture
def files(tmp_path):
    path = tmp_path / "5f3a"  # files travel by digest
    path.write_text(PARAMETERS)
    return {"params": str(path)}


def test_causes_and_first_errors_are_as_written(files, tmp_path, golden):
    """``causes.txt``: what a stack has printed, then the cause and the first error in it.

    A new case needs its lines only, ``pytest --update`` adds the rest. PARAMS stands for a file
    that a run has brought along, COPY for what launch has made of it.
    """
    copy = tmp_path / "launch_params_x"
    copy.write_text("\n" * 11 + PARAMETERS.splitlines()[7] + "\n")
    told = []
    for name, lines in cases(CAUSES):
        text = "\n".join(lines).replace("PARAMS", files["params"]).replace("COPY", str(copy))
        cause, first = find_cause(text.splitlines(), files), first_error(text.splitlines())
        results = (f"cause: {cause or '-'}", f"first error: {first or '-'}")
        shown = [line.replace(str(tmp_path), "FOLDER") for line in results]
        told += written((name, lines), shown)
    golden(CAUSES.name, "\n".join(told) + "\n")


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
