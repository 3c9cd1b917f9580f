"""Searches of campaign files: their tasks, and the values they begin at."""

import json
import re
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
import yaml

from daemon.campaign import load_campaign, read_budget, read_confirm, read_stop
from grammars.text import codec, plugins
from tests.campaign.loaded import digests, messages

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
SCENARIOS = {
    "calm": None,
    "busy": {
        "floorplan": "flat",
        "objects": "doors",
        "behaviours": "moving",
        "mission": "courier",
        "oracles": ["reached", "keeps-clear", "nearest", "flat"],
    },
    "two": {"like": "busy", "sut": ["pilot", "idle"]},
}
CLOSES = {"moving.closes": "5 .. 7 s"}


@pytest.fixture
def search(demo, campaign, tmp_path, monkeypatch):
    """Write a campaign with a search; the signal of one of its oracles is true or false."""
    (tmp_path / "their_signals.py").write_text(
        "from grammars.oracle import CustomSignal\n"
        "flag = CustomSignal(lambda trace, time: time > 5.0, 'bool')\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    entry = EntryPoint("their.flag", "their_signals:flag", "scenario.signals")
    monkeypatch.setattr(
        plugins, "installed", lambda group: {"their.flag": entry} if group == entry.group else {}
    )
    plugins.load_plugin.cache_clear()
    (demo / "moving.scenery").write_text(DOORS)
    (demo / "own.oracles.yaml").write_text("flat: never(their.flag)\n")

    def write(scenarios=SCENARIOS, **keys):
        keys = {"scenario": "busy", "minimise": "keeps-clear"} | keys
        oracles = ["navigation", "own"]
        return campaign(scenarios=scenarios, oracles=oracles, limit="3 min", search={"s": keys})

    yield write
    plugins.load_plugin.cache_clear()
    sys.modules.pop("their_signals", None)


def only_search(path):
    (task,) = load_campaign(path).searches
    return task


def test_searches_become_tasks(search, golden):
    """One search says little, the other one everything that can be said."""
    everything = {
        "about": "everything", "scenario": "two", "sut": "pilot", "minimise": "any",
        "over": {"moving.swing": "30 .. 90 deg/s, log"}, "budget": "200 runs, 10 min",
        "stop": "5 failures", "method": "halton", "confirm": 3, "then": "nearest", "window": 4,
        "seed": 9, "such that": "moving.swing > 40 deg/s",
    }  # fmt: skip
    tasks = [only_search(search(**keys)) for keys in ({"over": CLOSES}, everything)]
    texts = (json.dumps(codec.to_plain(task), indent=1) for task in tasks)
    golden("search_tasks.txt", "\n".join(texts) + "\n")


def test_searches_are_no_runs_and_change_none(search, campaign):
    expected = digests(search(over=CLOSES))
    assert digests(campaign(scenarios=SCENARIOS, oracles=["navigation", "own"], limit="3 min")) == (
        expected
    )


CASE = re.compile(r"((?:^--- .*\n)+)(?:(?!---).+\n)*", re.MULTILINE)


def test_ranges_and_choices_and_the_values_they_begin_at(search, golden):
    def renewed(block):
        *slots, over = (line[4:] for line in block[1].splitlines())
        slots = {"like": "busy", "behaviours": "doors_moving"} | (
            yaml.safe_load("\n".join(slots)) or {}
        )
        slots |= {"objects": [], "behaviours": []} if "vary" in slots else {}
        scenarios = SCENARIOS | {"changed": slots}
        task = only_search(search(scenarios, scenario="changed", over=yaml.safe_load(over)))
        (found,) = task.parameters
        begin = round(found.written, 9) if isinstance(found.written, float) else found.written
        span = found.choices or f"{found.low:g} .. {found.high:g}, in steps of {found.step:g}"
        name = f"{found.slot} {found.index} {found.key}"
        log = ", log" if found.log else ""
        return f"{block[1]}{name}: {begin} {found.unit} of {span}{log}\n"

    file = Path(__file__).with_name("search_values.txt")
    golden(file.name, CASE.sub(renewed, file.read_text("utf-8")))


def test_a_name_with_a_dash_means_the_parameter_with_a_stroke(search, demo):
    """Also where an inequality begins with a name that goes on like a list of words."""
    doors = DOORS.replace("closes", "swing_late")
    (demo / "moving.scenery").write_text(doors)
    late = "moving.swing-late < 6 s"
    over = {"moving.swing": ["60 deg/s", "70 deg/s"], "moving.swing-late": "5 .. 7 s"}
    task = only_search(search(over=over, **{"such that": late}))
    assert [(p.name, p.key) for p in task.parameters] == [
        ("moving.swing", "swing"), ("moving.swing-late", "swing_late")
    ]  # fmt: skip
    assert task.constraints == (late,)


def test_a_search_that_names_no_system_is_about_the_first_of_its_scenario(search):
    for suts in (["pilot", "idle"], ["idle", "pilot"]):
        scenarios = SCENARIOS | {"two": {"like": "busy", "sut": suts}}
        task = only_search(search(scenarios, scenario="two", minimise="any", over=CLOSES))
        assert task.sut == suts[0]


def test_flat_oracles_are_passed_over_where_any_is_searched(search):
    path = search(minimise="any", over=CLOSES)
    passed = [one for one in messages(path) if "follow flat" in one]
    assert len(passed) == 1
    assert ": warning: a search cannot follow flat, it is ignored" in passed[0]
    assert "flat" not in [scale.oracle for scale in only_search(path).scales]
    (refusal,) = messages(search(minimise="flat", over=CLOSES))
    assert "a search cannot follow flat: their.flag is true or false" in refusal


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
