"""What several parts of launch files need and nobody gives is said once."""

from grammars.roslaunch._messages import needed, said_once
from grammars.text.diagnostics import Diagnostic, Where

HERE = Where("a.launch", 2, 1)


def test_what_several_need_is_said_once_and_told_from_another_by_no_word_of_it():
    robot, arm = (
        Diagnostic(HERE, f"it is not given, which is needed for the {thing}")
        for thing in ("robot", "arm")
    )
    problems = [
        problem
        for one in (robot, arm)
        for by in ("/a", "/b")
        for problem in needed([one], by, HERE)
    ]
    assert [problem.message for problem in said_once(problems)] == [
        "it is not given, which is needed for the robot, which is needed for /a (a.launch:2)",
        "it is not given, which is needed for the arm, which is needed for /a (a.launch:2)",
    ]
