"""Searches of campaign files: what they come to, and what is said of those that make no sense."""

import shutil
import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from daemon.campaign import expand, load_campaign, read_budget, read_confirm, read_stop
from grammars.text import plugins
from tests.campaign.findings import findings_of

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


def test_a_search_that_names_no_system_is_about_the_first_of_its_scenario(write):
    path = write("  s: {scenario: two, minimise: any, over: {doors_moving.closes: 5 .. 7 s}}\n")
    assert only_search(path).sut == "pilot"
    path.write_text(path.read_text().replace("[pilot, idle]", "[idle, pilot]"))
    assert only_search(path).sut == "idle"


def test_flat_oracles_are_passed_over_where_any_is_searched(write):
    path = write(f"  s:\n    scenario: busy\n    minimise: any\n{OVER}")
    told = [one for one in said(path) if "flat" in one]
    assert told
    assert all(": warning: flat cannot be searched with, it is passed over" in t for t in told)
    assert "flat" not in [scale.oracle for scale in only_search(path).scales]
    (refused,) = said(write(f"  s:\n    scenario: busy\n    minimise: flat\n{OVER}"))
    assert "flat cannot be searched with: their.flag is true or false" in refused


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


def test_a_name_that_begins_like_a_list_of_words_is_compared_all_the_same(write):
    over = (
        "      doors_moving.swing: [60 deg/s, 70 deg/s]\n      doors_moving.swing-late: 5 .. 7 s\n"
    )
    path = write(f"{HEAD}    over:\n{over}    such that: doors_moving.swing-late < 6 s\n")
    doors = DOORS.replace("parameter closes", "parameter swing_late").replace(
        "closes", "swing_late"
    )
    (path.parent / "doors_moving.scenery").write_text(doors)
    assert only_search(path).constraints == ("doors_moving.swing-late < 6 s",)
