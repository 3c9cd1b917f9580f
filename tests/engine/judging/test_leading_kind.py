"""What is known of leading margins before anything runs, and what a search is told instead."""

import re
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from daemon.judging.leading_kind import LEADING_FLAGS, leading_kind, oracle_scale
from daemon.judging.oracles import judge_leading
from daemon.model.spec import OracleText
from grammars.oracle import CustomOracle, CustomSignal, parse_oracle
from grammars.text import plugins
from grammars.text.diagnostics import Where
from tests.engine.judging.traces import ROBOT, along, make_trace, times

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "oracles.md"

busy = CustomSignal(lambda trace, time: time > 5.0, "bool")
tidy = CustomOracle(lambda trace: (1.0, 1.0), "bool")
smooth = CustomOracle(lambda trace: (0.25, 0.25), "m/s^2")


@pytest.fixture(autouse=True)
def plugged(monkeypatch):
    groups = {"scenario.signals": ("busy",), "scenario.oracles": ("tidy", "smooth")}
    entries = {
        group: {name: EntryPoint(name, f"{__name__}:{name}", group) for name in names}
        for group, names in groups.items()
    }
    plugins.load_plugin.cache_clear()
    monkeypatch.setattr(plugins, "installed", entries.__getitem__)
    yield
    plugins.load_plugin.cache_clear()


def oracle(text):
    return parse_oracle("it", text, Where("o.yaml", 1, 1))


TRACE = make_trace(along(times(10.0)))


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("never(contact)", "m"),
        ("always(speed <= 0.8 m/s)", "m/s"),
        ("always(loc.inside_2sigma)", "m"),
        ("eventually(mission.reached >= 3)", "1"),
        ("never(contact) until (mission.reached >= 1)", "m"),
        ("always(speed <= 0.8 m/s or not contact)", "1"),
        ("always(clearance > 0 m and not contact)", "m"),
        ("never(busy and contact)", "1"),
        ("time(busy) <= 5 s", "s"),
        ("fraction(loc.inside_2sigma) >= 95 %", "1"),
        ("count(contact) <= 2", "1"),
        ("p95(abs(command.angular)) <= 60 deg/s", "rad/s"),
        ("reached(mission, 0.25 m)", "m"),
        ("smooth()", "m/s^2"),
    ],
)
def test_what_leads_says_in_which_unit(text, unit):
    found = leading_kind(oracle(text))
    assert (found.led, found.unit, found.reason, found.better) == (True, unit, "", "")
    _, (lead,) = judge_leading(TRACE, (OracleText("it", text),))
    assert lead.unit == unit


@pytest.mark.parametrize(
    ("text", "reason", "better"),
    [
        ("never(busy)", "busy is true or false", "always(clearance >= 0 m)"),
        ("always(not busy or busy)", "(not busy) or busy is true or false", "always(clearance"),
        ("eventually(busy)", "busy is true or false", "reached(mission, 0.25 m)"),
        ("never(busy) until (contact)", "busy is true or false", "always(clearance >= 0 m)"),
        ("tidy()", "tidy is true or false", "reached(mission, 0.25 m)"),
        ("min(clearance)", "it has no limit", "min(clearance) >= 1 m"),
        ("max(speed)", "it has no limit", "max(speed) <= 1 m/s"),
        ("final(mission.reached)", "it has no limit", "final(mission.reached) <= 1"),
        ("time(contact) on leg 1", "it has no limit", "time(contact) <= 1 s"),
        ("fraction(contact)", "it has no limit", "fraction(contact) <= 10 %"),
        ("count(contact)", "it has no limit", "count(contact) <= 1"),
    ],
)
def test_what_is_flat_is_told_with_a_better_one(text, reason, better):
    found = leading_kind(oracle(text))
    assert not found.led
    assert reason in found.reason
    assert better in found.better
    for suggested in found.better.split(" or "):
        assert leading_kind(oracle(suggested)).led


@pytest.mark.parametrize(
    ("text", "scale", "unit"),
    [
        ("always(clearance >= 5 cm)", 0.05, "m"),
        ("always(5 cm <= clearance)", 0.05, "m"),
        ("always(speed.forward >= -0.1 m/s)", 0.1, "m/s"),
        ("always(loc.error <= 3 * loc.sigma.x)", 1.0, "m"),
        ("always(clearance >= 0 m)", 1.0, "m"),
        ("always(clearance >= 0 m and clearance(door-17) >= 0.2 m)", 0.2, "m"),
        ("always(clearance >= 1 m and clearance(door-17) >= 0.2 m)", 1.0, "m"),
        ("always(clearance >= 0.1 m and speed <= 2 m/s)", 1.0, "1"),
        ("never(contact)", 0.233, "m"),
        ("reached(mission, 0.25 m)", 0.25, "m"),
        ("time(contact) <= 5 s", 5.0, "s"),
        ("count(contact) <= 0", 1.0, "1"),
        ("max(speed) <= 80 cm/s", 0.8, "m/s"),
        ("smooth()", 1.0, "m/s^2"),
    ],
)
def test_margins_are_compared_by_their_limits(text, scale, unit):
    found = oracle_scale(oracle(text), ROBOT)
    assert (found.oracle, found.scale, found.unit) == ("it", pytest.approx(scale), unit)


def test_the_table_of_the_documentation_has_every_operator():
    section = PAGE.read_text("utf-8").partition("## Margins that lead")[2].partition("\n## ")[0]
    rows = " ".join(row for row in section.split("\n") if row.startswith("| "))
    grammar = (ROOT / "grammars" / "oracle" / "oracle.tx").read_text("utf-8")
    rules = re.findall(r"(?:Temporal|Amount|Statistic)Operator:\s*(.*?);", grammar, re.DOTALL)
    words = {word for rule in rules for word in re.findall(r"[\"'](\w+)[\"']", rule)}
    assert {"always", "count", "p95"} < words
    told = {*words, "reached"}
    assert [word for word in sorted(told) if not re.search(rf"`{word}\b", rows)] == []
    assert "until" in rows
    assert "within" in rows
    assert [flag for flag in sorted(LEADING_FLAGS) if f"`{flag}" not in rows] == []
