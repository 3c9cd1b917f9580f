"""What benchmarks say, and the table of goals; that all of them say it in the one way."""

import ast
import io
from pathlib import Path

import pytest

from tests.benchmarks.__main__ import Made, benchmarks, main
from tests.benchmarks.measurement import (
    Measurement,
    Reference,
    at_least,
    at_most,
    beside_yardstick,
    in_turns,
)
from tests.benchmarks.printing import goal_table, line, part_table
from tests.benchmarks.progress import ERASE, Progress

FOLDER = Path(__file__).parent / "benchmarks"
SPEED = Measurement("S1", 130.0, "x real time", Reference("then", 100.0))
ALONE = Measurement("--help", 0.3, "CPU s")


@pytest.mark.parametrize("name", benchmarks())
def test_every_benchmark_yields_measurements(name):
    tree = ast.parse((FOLDER / f"bench_{name}.py").read_text("utf-8"))
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    (measure,) = [one for one in functions if one.name == "measure"]
    assert any(isinstance(node, ast.Yield | ast.YieldFrom) for node in ast.walk(measure))
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
def test_a_goal_is_of_the_value_or_of_its_ratio(one, goal, met):
    assert one.met(goal) is met


def test_the_table_has_a_row_for_each_goal():
    fast = Measurement(
        "S1", 130.0, "x real time", SPEED.reference, (at_least(120.0), at_least(2, of_ratio=True))
    )
    slow = Measurement("--help", 0.3, "CPU s", None, (at_most(0.2), at_most(0.5, of_ratio=True)))
    made = [("ros", fast), ("run", SPEED), ("reactions", slow)]
    assert list(goal_table(made)) == [
        "what               goal                measured         ratio        met",
        "ros: S1            >= 120 x real time  130 x real time  1.30 x then  yes",
        "ros: S1            >= 2 x reference    130 x real time  1.30 x then  NO",
        "reactions: --help  <= 0.2 CPU s        0.300 CPU s      -            NO",
        "reactions: --help  <= 0.5 x reference  0.300 CPU s      -            NO",
    ]
    assert list(goal_table([("run", SPEED)])) == []


LONG = Measurement(
    "walls, in pieces of a tenth of what they were: a run", 1013.25, "x real time",
    Reference("corridor, doors at rest, and nobody there", 977.0), (at_least(1000.0),),
    "0.296 CPU s for 300 s, trace 1220 kB/min, and more that somebody may want to know",
)  # fmt: skip


@pytest.mark.parametrize("columns", [80, 120])
def test_table_and_lines_fit(columns):
    table = list(goal_table([("scaling", LONG)], columns))
    lines = line(LONG, columns).splitlines()
    assert max(map(len, table + lines)) <= columns
    for said in (table, lines):
        words = [word.rstrip(";") for word in " ".join(said).split()]
        assert set(f"{LONG.name} 1013 {LONG.unit} 1.04 x".split()) <= set(words)
    assert LONG.reference is not None
    assert (LONG.reference.name.split()[0] in " ".join(table)) is (columns == 120)
    assert set(f"{LONG.reference.name} {LONG.note}".split()) <= set(" ".join(lines).split())


def test_parts_are_listed_by_the_time_they_took():
    assert list(part_table([("run", 12.4), ("ros", 30.1)])) == ["42 s in all: ros 30, run 12"]


class Screen(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self):
        return True


def test_progress_is_a_line_for_each_step_in_a_file():
    file = io.StringIO()
    progress = Progress(file)
    for done in range(5):
        progress.say(f"{done} of 4 runs", done // 2)
    progress.clear()
    progress.say("the report")
    progress.say("the report")
    said = ["0 of 4 runs", "2 of 4 runs", "4 of 4 runs", "the report", "the report"]
    assert file.getvalue() == "".join(f"  {one}\n" for one in said)


def test_progress_stands_in_one_place_on_a_terminal():
    screen = Screen()
    progress = Progress(screen)
    for done in range(3):
        progress.say(f"{done} of 2 runs", 0)
    progress.clear()
    progress.clear()
    assert screen.getvalue().split(ERASE) == ["", *(f"  {k} of 2 runs" for k in range(3)), ""]
    assert "\n" not in screen.getvalue()


def test_one_that_fails_says_how_and_does_not_hide_the_others(capsys):
    def fails():
        yield SPEED
        raise OSError("no room is left")

    made = Made()
    made.add("bad", "bad", fails)
    made.add("good", "good", lambda: [SPEED])
    assert [name for name, _ in made.measurements] == ["bad", "good"]
    assert [name for name, _ in made.parts] == ["bad", "good"]
    assert made.failed == ["bad"]
    assert "no room is left" in capsys.readouterr().err


def test_what_has_no_reference_is_held_against_the_yardstick():
    assert beside_yardstick(SPEED, 0.1) is SPEED
    assert beside_yardstick(ALONE, 0.1).ratio == pytest.approx(3.0)
    in_ms = Measurement("lease", 300.0, "ms")
    assert beside_yardstick(in_ms, 0.1).ratio == pytest.approx(3.0)
    runs = Measurement("runs", 30.0, "/s")
    assert beside_yardstick(runs, 0.1).ratio == pytest.approx(3.0)
    memory = beside_yardstick(Measurement("memory", 3.0, "MB"), 0.1).reference
    assert memory is not None
    assert memory.value > 3.0


def test_a_line_says_the_ratio_and_the_reference():
    assert line(SPEED).split() == ["S1", "130", "x", "real", "time", "1.30", "x", "then", "(100)"]


def test_counts_are_whole():
    lost = Measurement("lost", 0, "runs", Reference("all runs", 120), (at_most(0.0),))
    assert line(lost).split() == ["lost", "0", "runs", "0.00", "x", "all", "runs", "(120)"]


def test_works_take_turns_every_other_round_backwards():
    done = []
    works = {name: lambda name=name: done.append(name) for name in "ab"}
    took = in_turns(works, 3)
    assert "".join(done) == "abbaab"
    assert {name: len(times) for name, times in took.items()} == {"a": 3, "b": 3}


def test_a_benchmark_that_is_not_there_is_said():
    with pytest.raises(SystemExit, match=r"no benchmark rum; there are: .*run.*against"):
        main(["rum"])
