"""``planner``: exact or incremental, and who is told what about it."""

from dataclasses import asdict

import pytest

from daemon.stacks.findings import ParameterError
from daemon.stacks.ros1.configuration import read_ros
from daemon.stacks.ros1.navfn import IncrementalNavfn, IncrementalNavfnParameters, Navfn
from daemon.stacks.ros1.planners import make_global_planner
from tests.daemon.stacks.ros1.test_configuration import tree


def planner_of(**sections):
    read = read_ros(tree() | sections)
    return type(make_global_planner(read.global_planner, read.quirks))


def test_plans_are_made_as_by_ros_unless_somebody_asks_for_another_way():
    assert planner_of() is planner_of(planner="exact") is Navfn
    assert planner_of(planner="incremental") is IncrementalNavfn


def test_the_parameters_are_those_of_navfn():
    given = tree(NavfnROS={"allow_unknown": False})
    exact, quick = read_ros(given), read_ros(given | {"planner": "incremental"})
    assert asdict(exact.global_planner) == asdict(quick.global_planner)
    assert isinstance(quick.global_planner, IncrementalNavfnParameters)
    assert exact.findings == quick.findings


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("incremetal", "must be exact or incremental (given: 'incremetal')|\"incremental\""),
        (True, "must be exact or incremental (given: True)|"),
        ({"like": "exact"}, "must be exact or incremental (given: {'like': 'exact'})|"),
    ],
)
def test_another_word_is_an_error(given, expected):
    with pytest.raises(ParameterError) as caught:
        read_ros(tree() | {"planner": given})
    (problem,) = caught.value.problems
    message, hint = expected.split("|")
    assert problem.path == ("planner",)
    assert problem.message == message
    assert hint in problem.hint


def test_another_global_planner_cannot_plan_incrementally():
    given = tree(move_base={"base_global_planner": "global_planner/GlobalPlanner"})
    with pytest.raises(ParameterError) as caught:
        read_ros(given | {"planner": "incremental"})
    (problem,) = caught.value.problems
    assert problem.path == ("planner",)
    assert problem.message == (
        "only navfn/NavfnROS can plan incrementally, and the global planner is "
        "global_planner/GlobalPlanner"
    )
    assert "navfn/NavfnROS" in problem.hint


def test_with_a_tolerance_it_is_said_that_nothing_is_gained():
    given = tree(NavfnROS={"default_tolerance": 0.2})
    (finding,) = read_ros(given | {"planner": "incremental"}).findings.without_effect
    assert finding.path == ("planner",)
