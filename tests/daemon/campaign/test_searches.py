"""Searches of campaign files: what they come to, and what is said of those that make no sense."""

import shutil
import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from daemon.campaign import expand, load_campaign, read_budget, read_confirm, read_stop
from grammars.text import plugins
from grammars.text.diagnostics import Severity
from tests.daemon.campaign.findings import findings_of

DOORS = """\
parameter swing = 60 deg/s
parameter closes = 6 s
parameter opens = 0.5 min
parameter near = 80 cm
group leading: bedroom_door

all leading moves to open at 0 s, to closed at closes, to open at opens, by servo at swing
kitchen_door moves to closed at 8 s, to open at 9 s
living_room_door goes from open to closed when the robot is within near of its doorway
"""
CAMPAIGN = """\
campaign: tiny
seed: 3
limit: 3 min
robot: courier
oracles: [navigation, own]
matrix: {sut: [pilot]}
scenarios:
  busy:
    floorplan: flat
    objects: doors
    behaviours: doors_moving
    mission: courier
    oracles: [reached, keeps-clear, nearest, flat]
  calm: {like: busy, behaviours: doors_open}
  two: {like: base, sut: [pilot, idle]}
  base: {like: busy, abstract: true}
search:
"""
HEAD = "  s:\n    scenario: busy\n    minimise: keeps-clear\n"

Write = Callable[[str], Path]


@pytest.fixture(autouse=True)
def plugged(tmp_path, monkeypatch):
    """A signal of somebody's that is true or false: nothing leads to it."""
    text = "from grammars.oracle import CustomSignal\n"
    text += "flag = CustomSignal(lambda trace, time: time > 5.0, 'bool')\n"
    (tmp_path / "their_signals.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    entry = EntryPoint("their.flag", "their_signals:flag", "scenario.signals")
    monkeypatch.setattr(
        plugins, "installed", lambda group: {"their.flag": entry} if group == entry.group else {}
    )
    plugins.load_plugin.cache_clear()
    yield
    plugins.load_plugin.cache_clear()
    sys.modules.pop("their_signals", None)


@pytest.fixture
def write(tmp_path, campaigns):
    """Write a campaign with a search, the lines of which are given, and its layers."""
    folder = Path(shutil.copytree(campaigns / "demo", tmp_path / "mine"))
    (folder / "doors_moving.scenery").write_text(DOORS)
    (folder / "own.oracles.yaml").write_text("flat: never(their.flag)\n")

    def write(text):
        path = folder / "tiny.yaml"
        path.write_text(CAMPAIGN + text)
        return path

    return write


def only_search(path):
    (task,) = load_campaign(path).searches
    return task


def said(path):
    """Return what is said of a campaign, without the folder of its files."""
    about = findings_of(path)
    return [str(one).replace(f"{path.parent}/", "") for one in about if "tiny" in one.where.file]


def test_a_search_that_says_little_has_defaults(write):
    task = only_search(write(HEAD + "    over: {doors_moving.closes: 5 .. 7 s}\n"))
    assert (task.runs, task.seconds, task.stop, task.method) == (60, 0.0, "budget", "auto")
    assert (task.confirm, task.then, task.window) == (5, ("nearest", "shrink"), 8)
    assert (task.sut, task.seed, task.repeatable, task.constraints) == ("pilot", 3, True, ())
    (scale,) = task.scales
    assert (scale.oracle, scale.scale, scale.unit) == ("keeps-clear", 0.05, "m")
    (parameter,) = task.parameters
    assert (parameter.slot, parameter.index, parameter.key) == ("behaviours", 0, "closes")
    assert (parameter.low, parameter.high, parameter.unit) == (5.0, 7.0, "s")
    assert (parameter.step, parameter.written, parameter.where) == (0.01, 6.0, "tiny.yaml:21")


def test_everything_can_be_said(write):
    text = """\
  all-of-it:
    about: everything
    scenario: two
    sut: pilot
    minimise: any
    over:
      doors_moving.swing: 30 .. 90 deg/s, log
      doors-moving.nothing: 1 .. 2 s
    budget: 200 runs, 10 min
"""
    task = only_search(
        write(
            text.replace("      doors-moving.nothing: 1 .. 2 s\n", "")
            + "    stop: 5 failures\n    method: halton\n    confirm: 3\n    then: nearest\n"
            + "    window: 4\n    seed: 9\n    such that: doors_moving.swing > 40 deg/s\n"
        )
    )
    assert (task.name, task.about, task.sut, task.minimise) == (
        "all-of-it",
        "everything",
        "pilot",
        "any",
    )
    assert (task.runs, task.seconds, task.stop, task.failures) == (200, 600.0, "failures", 5)
    assert (task.method, task.confirm, task.then) == ("halton", 3, ("nearest",))
    assert (task.window, task.seed) == (4, 9)
    assert task.constraints == ("doors_moving.swing > 40 deg/s",)
    assert task.parameters[0].log
    assert [scale.oracle for scale in task.scales] == ["reached", "keeps-clear"]


def test_searches_are_no_runs_and_change_none(write):
    without = write("").read_text().partition("search:")[0]
    path = write(HEAD + "    over: {doors_moving.closes: 5 .. 7 s}\n")
    runs = [run.digest for run in expand(load_campaign(path)).specs]
    path.write_text(without)
    assert [run.digest for run in expand(load_campaign(path)).specs] == runs


@pytest.mark.parametrize(
    ("over", "low", "high", "unit", "step", "written"),
    [
        ("doors_moving.opens: 20 .. 40 s", 20.0, 40.0, "s", 0.01, 30.0),
        ("doors_moving.opens: 0.3 .. 0.7 min", 0.3, 0.7, "min", 0.0001, 0.5),
        ("doors_moving.near: 50 cm .. 1 m", 0.5, 1.0, "m", 0.001, 0.8),
        ("doors_moving.near: 50 .. 100 cm", 50.0, 100.0, "cm", 0.1, 80.0),
        ("doors_moving.swing: 0.5 .. 1.5 rad/s", 0.5, 1.5, "rad/s", 0.001, 1.0471975512),
        ("doors_moving.closes: 5.9 .. 6.1 s", 5.9, 6.1, "s", 0.01, 6.0),
        ("doors_moving.closes: 5.99 .. 6.01 s", 5.99, 6.01, "s", 0.0001, 6.0),
        ("doors_moving.closes: 0.01 .. 10 s, log", 0.01, 10.0, "s", 0.001, 6.0),
    ],
)
def test_ranges_are_in_the_unit_they_are_written_in(over, low, high, unit, step, written, write):
    (parameter,) = only_search(write(HEAD + f"    over:\n      {over}\n")).parameters
    assert (parameter.low, parameter.high, parameter.unit) == (low, high, unit)
    assert parameter.step == step
    assert parameter.written == pytest.approx(written, rel=1e-10)


def test_choices_are_names_or_quantities(write):
    over = "{doors_moving.leading: [bedroom_door, kitchen_door], doors_moving.near: [0.8 m, 50 cm]}"
    leading, near = only_search(write(HEAD + f"    over: {over}\n")).parameters
    assert (leading.choices, leading.written) == (("bedroom_door", "kitchen_door"), "bedroom_door")
    assert (near.choices, near.written) == (("0.8 m", "50 cm"), "0.8 m")


def test_a_name_with_a_dash_means_the_parameter_with_a_stroke(write):
    path = write(HEAD + "    over: {doors_moving.closes: 5 .. 7 s}\n")
    layer = path.with_name("doors_moving.scenery")
    layer.write_text(layer.read_text().replace("closes", "door_closes"))
    path.write_text(path.read_text().replace("doors_moving.closes", "doors_moving.door-closes"))
    (parameter,) = only_search(path).parameters
    assert (parameter.name, parameter.key) == ("doors_moving.door-closes", "door_closes")


OVER = "    over: {doors_moving.closes: 5 .. 7 s, doors_moving.opens: 20 .. 40 s}\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("  s: {scenario: bussy, minimise: any, over: {a.b: 1 .. 2 s}}\n", 'no scenario "bussy"'),
        ("  s: {scenario: base, minimise: any, over: {a.b: 1 .. 2 s}}\n", "is abstract"),
        (
            "  s: {scenario: busy, sut: idle, minimise: any, over: {a.b: 1 .. 2 s}}\n",
            'not run with a system under test "idle"',
        ),
        ("  calm: {scenario: busy, minimise: any, over: {a.b: 1 .. 2 s}}\n", 'scenario "calm"'),
        (
            "  s.1: {scenario: busy, minimise: any, over: {a.b: 1 .. 2 s}}\n",
            'letters (a to z), digits, "_" and "-", 40 at most',
        ),
        (f"  {'x' * 40}: {{scenario: busy, minimize: any, over: {{a.b: 1 .. 2 s}}}}\n", "minimise"),
        ("  s: {scenario: busy, minimise: any, over: {}}\n", "must have 1 or more"),
        ("  s: {scenario: busy, minimise: any}\n", 'key "over" is missing'),
        (f"  s:\n    scenario: busy\n    minimise: nearest\n{OVER}", "it measures and never fails"),
        (f"  s:\n    scenario: busy\n    minimise: keep-clear\n{OVER}", 'mean "keeps-clear"'),
        (f"  s:\n    scenario: busy\n    minimise: flat\n{OVER}", "is true or false"),
        (
            "  s: {scenario: calm, minimise: keeps-clear, over: {a.b: 1 .. 2 s}, "
            "budget: 60 runs, 10 min}\n",
            'inside of { } what has a comma is quoted: "..., 10 min"',
        ),
        (
            f"  s:\n    scenario: busy\n    minimise: localised\n{OVER}",
            "add localised to the oracles: of the scenario",
        ),
        (HEAD + "    over: {doors.closes: 5 .. 7 s}\n", 'has no parameter "closes"'),
        (HEAD + "    over: {door_moving.closes: 5 .. 7 s}\n", 'did you mean "doors_moving"?'),
        (HEAD + "    over: {closes: 5 .. 7 s}\n", "write doors_moving.closes"),
        (HEAD + "    over: {doors_moving.close: 5 .. 7 s}\n", 'mean "closes"?'),
        (HEAD + "    over: {keeps-clear.limit: 5 .. 7 cm}\n", "limits of oracles are not searched"),
        (
            HEAD + "    over: {doors_moving.closes: 5 .. 7 m}\n",
            "a time is needed here, 5 m is a length",
        ),
        (HEAD + "    over: {doors_moving.closes: 5 .. 7}\n", "a time is needed here, 5 is a ratio"),
        (HEAD + "    over: {doors_moving.closes: 7 .. 5 s}\n", "begins above its end"),
        (HEAD + "    over: {doors_moving.closes: 5 .. 5 s}\n", "is empty: widen it"),
        (HEAD + "    over: {doors_moving.closes: 5 .. 1e400 s}\n", "has no end"),
        (HEAD + "    over: {doors_moving.closes: 5 .. 7 s, log}\n", "what has a comma is quoted"),
        (HEAD + '    over: {doors_moving.closes: "0 .. 5 s, log"}\n', "begins above 0"),
        (HEAD + "    over: {doors_moving.closes: 5 .. 7 parsec}\n", "is not a unit"),
        (HEAD + "    over: {doors_moving.closes: 6 s}\n", "is no range"),
        (HEAD + "    over: {doors_moving.closes: [6 s]}\n", "two choices or more"),
        (HEAD + "    over: {doors_moving.closes: [6 s, 6 s]}\n", "is there twice"),
        (
            HEAD + "    over: {doors_moving.closes: [1 min, 60 s]}\n",
            "1 min and 60 s are the same value",
        ),
        (
            HEAD + "    over: {doors_moving.closes: [6 s, 2 m]}\n",
            "a time is needed here, 2 m is a length",
        ),
        (
            HEAD + "    over: {doors_moving.leading: 1 .. 2 s}\n",
            "bedroom_door cannot be in a range",
        ),
        (
            HEAD + OVER + "    such that: [doors_moving.close < 8 s]\n",
            'mean "doors_moving.closes"?',
        ),
        (
            HEAD + OVER + "    such that: [doors_moving.leading < 8 s]\n",
            "vary it, or write its value",
        ),
        (
            HEAD + OVER + "    such that: [1 s < doors_moving.closes < 8 s]\n",
            'join two of them with "and"',
        ),
        (HEAD + OVER + "    such that: [doors_moving.closes < 8 m]\n", "compares s with m"),
        (HEAD + OVER + "    such that: [doors_moving.closes]\n", "not something true or false"),
        (
            HEAD + "    over: {doors_moving.closes: [5 s, 6 s]}\n"
            "    such that: [doors_moving.closes < 8 s]\n",
            "doors_moving.closes is a list of words",
        ),
        (HEAD + "    over: {robot.laser.noises: 1 .. 2 cm}\n", 'mean "noise"?'),
        (HEAD + "    over: {courier.x: 1 .. 2 cm}\n", 'unknown key "x"'),
        (HEAD + "    over: {robot.laser: 1 .. 2 cm}\n", "laser: must be keys with values"),
        (
            HEAD + "    over: {mission.start.y: 0 .. 1, courier.start.y: 0 .. 2}\n",
            "courier.start.y and mission.start.y are the same value",
        ),
        (HEAD + OVER + "    budget: many\n", "is no budget"),
        (HEAD + OVER + "    budget: 0 runs\n", "1 to 10000 runs"),
        (HEAD + OVER + "    budget: 20000\n", "1 to 10000 runs"),
        (HEAD + OVER + "    stop: soon\n", "is no end of a search"),
        (HEAD + OVER + "    confirm: 500 repeats\n", "100 at most"),
        (HEAD + OVER + "    then: boundary\n", "nearest"),
        (HEAD + OVER + "    window: 0\n", "greater than or equal to 1"),
    ],
)
def test_what_makes_no_sense_is_told_with_its_line(text, expected, write):
    told = said(write(text))
    first = told[0]
    assert expected in "\n".join(told)
    assert first.startswith("tiny.yaml:")
    line = int(first.split(":")[1])
    assert line >= CAMPAIGN.count("\n")
    assert ": warning:" not in first


def test_what_is_written_never_becomes_the_hint(write):
    text = '"doors_moving.closes 1 s; or later < 8 s"'
    (told,) = said(write(HEAD + OVER + f"    such that: [{text}]\n"))
    assert told.endswith(f'{text}: cannot read on at "1"')


def test_a_written_value_outside_of_its_range_is_a_warning(write):
    path = write(HEAD + "    over: {doors_moving.closes: 7 .. 9 s}\n")
    (told,) = said(path)
    assert "tiny.yaml:21:12: warning: doors_moving.closes is 6 s as written" in told
    assert only_search(path).parameters[0].written == 6.0


def test_a_search_that_names_no_system_is_about_the_first_of_its_scenario(write):
    path = write("  s: {scenario: two, minimise: any, over: {doors_moving.closes: 5 .. 7 s}}\n")
    assert only_search(path).sut == "pilot"
    path.write_text(path.read_text().replace("[pilot, idle]", "[idle, pilot]"))
    assert only_search(path).sut == "idle"


def test_what_is_wrong_with_one_search_hides_no_other_one(write):
    path = write(
        "  a: {scenario: bussy, minimise: any, over: {a.b: 1 .. 2 s}}\n"
        "  b: {scenario: busy, minimise: any, over: {doors_moving.closes: 1 .. 2 m}}\n"
        "  c: {scenario: busy, minimise: keeps-clear, over: {doors_moving.closes: 5 .. 7 s}}\n"
        "  d: {scenario: busy, minimise: any, over: {a.b: 1 .. 2 s}}\n"
    )
    lines = {d.where.line for d in findings_of(path) if d.severity is Severity.ERROR}
    first = CAMPAIGN.count("\n") + 1
    assert lines == {first, first + 1, first + 3}


def test_flat_oracles_are_passed_over_where_any_is_searched(write):
    path = write(f"  s:\n    scenario: busy\n    minimise: any\n{OVER}")
    told = [one for one in said(path) if "flat" in one]
    assert told
    assert all(": warning: flat cannot be searched with, it is passed over" in t for t in told)
    assert "flat" not in [scale.oracle for scale in only_search(path).scales]


def test_amounts_are_read_in_words():
    assert read_budget("1 run") == (1, 0.0)
    assert read_budget("10 min") == (10_000, 600.0)
    assert read_budget("10 min, 60 runs") == (60, 600.0)
    assert read_stop("first failure") == ("failures", 1)
    assert read_stop("when settled") == ("settled", 1)
    assert read_stop("budget") == ("budget", 1)
    assert (read_confirm("5 repeats"), read_confirm("0")) == (5, 0)
    for read, text in ((read_budget, "60 runs, 10 runs"), (read_stop, "0 failures")):
        with pytest.raises(ValueError, match=text):
            read(text)
