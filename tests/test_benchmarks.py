"""What benchmarks say, and the table of goals; that all of them say it in the one way."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.benchmarks.__main__ import benchmarks, main
from tests.benchmarks.measurement import (
    Goal,
    Measurement,
    Reference,
    at_least,
    at_most,
    beside_yardstick,
    goal_table,
    in_turns,
    line,
)

FOLDER = Path(__file__).parent / "benchmarks"
SPEED = Measurement("S1", 130.0, "x real time", Reference("then", 100.0))
ALONE = Measurement("--help", 0.3, "CPU s")


@pytest.mark.parametrize("name", benchmarks())
def test_every_benchmark_yields_measurements(name: str) -> None:
    tree = ast.parse((FOLDER / f"bench_{name}.py").read_text("utf-8"))
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    (measure,) = [one for one in functions if one.name == "measure"]
    assert ast.unparse(measure.returns or ast.Constant("")) == "Iterator[Measurement]"
    assert "main" not in {one.name for one in functions}
    left_out = [
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "LONG"
    ]
    assert all(isinstance(reason, str) for reason in left_out)


@pytest.mark.parametrize(
    ("one", "goal", "met"),
    [
        (SPEED, at_least(130.0), True),
        (SPEED, at_least(1.35, of_ratio=True), False),
        (SPEED, at_least(1.3, of_ratio=True), True),
        (ALONE, at_most(0.3), True),
        (ALONE, at_most(0.2), False),
        (ALONE, at_most(0.5, of_ratio=True), False),
    ],
)
def test_a_goal_is_of_the_value_or_of_its_ratio(one: Measurement, goal: Goal, met: bool) -> None:
    assert one.met(goal) is met


def test_the_table_has_a_row_for_each_goal() -> None:
    fast = Measurement(
        "S1", 130.0, "x real time", SPEED.reference, (at_least(120.0), at_least(2, of_ratio=True))
    )
    slow = Measurement("--help", 0.3, "CPU s", None, (at_most(0.2), at_most(0.5, of_ratio=True)))
    assert list(goal_table([("ros", fast), ("run", SPEED), ("reactions", slow)])) == [
        "what               goal                measured                       met",
        "ros: S1            >= 120 x real time  130 x real time (1.30 x then)  yes",
        "ros: S1            >= 2 x reference    1.30 x then                    NO",
        "reactions: --help  <= 0.2 CPU s        0.300 CPU s                    NO",
        "reactions: --help  <= 0.5 x reference  no reference here              NO",
    ]
    assert list(goal_table([("run", SPEED)])) == []


def test_what_has_no_reference_is_held_against_the_yardstick() -> None:
    assert beside_yardstick(SPEED, 0.1) is SPEED
    assert beside_yardstick(ALONE, 0.1).ratio == pytest.approx(3.0)
    in_ms = Measurement("lease", 300.0, "ms")
    assert beside_yardstick(in_ms, 0.1).ratio == pytest.approx(3.0)
    runs = Measurement("runs", 30.0, "/s")
    assert beside_yardstick(runs, 0.1).ratio == pytest.approx(3.0)
    assert beside_yardstick(Measurement("memory", 3.0, "MB"), 0.1).reference is None


def test_a_line_says_the_ratio_and_the_reference() -> None:
    assert line(SPEED).split() == ["S1", "130", "x", "real", "time", "1.30", "x", "then", "(100)"]


def test_works_take_turns_every_other_round_backwards() -> None:
    done: list[str] = []
    works = {name: lambda name=name: done.append(name) for name in "ab"}  # type: ignore[misc]
    took = in_turns(works, 3)
    assert "".join(done) == "abbaab"
    assert {name: len(times) for name, times in took.items()} == {"a": 3, "b": 3}


def test_a_benchmark_that_is_not_there_is_said() -> None:
    with pytest.raises(SystemExit, match=r"no benchmark rum; there are: .*run.*against"):
        main(["rum"])
