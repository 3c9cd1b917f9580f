"""Searches are tried before their first run: values that make no run are told with a remedy."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.campaign import load_campaign
from daemon.search.composition import search_case
from daemon.search.preparation import check_search
from scenario_tui.library.checking import check_file

DOORS = """\
parameter swing = 60 deg/s
parameter closes = 6 s
parameter opens = 14 s

bedroom_door moves to open at 0 s, to closed at closes, to open at opens, by servo at swing
"""
CAMPAIGN = """\
campaign: tiny
limit: 3 min
robot: courier
oracles: navigation
matrix: {sut: [pilot]}
scenarios:
  busy: {floorplan: flat, objects: doors, behaviours: [doors_open, doors_moving], mission: courier,
         oracles: [keeps-clear]}
search:
  s:
    scenario: busy
    minimise: keeps-clear
    method: halton
"""
LINE = CAMPAIGN.count("\n") + 2


@pytest.fixture
def folder(tmp_path, campaigns):
    """The layers of the demonstration, with a door whose times have names."""
    folder = Path(shutil.copytree(campaigns / "demo", tmp_path / "mine"))
    (folder / "doors_moving.scenery").write_text(DOORS)
    return folder


def load(folder, rest):
    """Load a campaign with a search of which the rest is given."""
    path = folder / "tiny.yaml"
    path.write_text(CAMPAIGN + rest)
    return load_campaign(path)


def said(folder, rest):
    """Return what checking says of that search."""
    campaign = load(folder, rest)
    (task,) = campaign.searches
    return told(folder, check_search(search_case(campaign, task)))


def told(folder, found):
    return [str(one).replace(f"{folder}/", "") for one in found]


OVER = "    over:\n      doors_moving.closes: {}\n      doors_moving.opens: {}\n"


def test_nothing_is_said_of_a_sound_search(folder):
    assert said(folder, OVER.format("4 .. 10 s", "12 .. 20 s")) == []
    ordered = "    such that: [doors_moving.closes + 0.5 s <= doors_moving.opens]\n"
    assert said(folder, OVER.format("4 .. 20 s", "5 .. 25 s") + ordered) == []


def test_an_end_of_a_range_that_makes_no_run_is_told_where_it_stands(folder):
    (found,) = said(folder, OVER.format("4 .. 15 s", "13 .. 20 s"))
    assert found.startswith(f"tiny.yaml:{LINE}:7: doors_moving.closes at 15 s makes no run: ")
    assert "14 s is not after 15 s (doors_moving.scenery:5:" in found
    assert "write what must hold under such that" in found


def test_a_scenario_that_makes_no_run_is_told_once(folder):
    campaign = load(folder, OVER.format("4 .. 10 s", "12 .. 20 s"))
    (task,) = campaign.searches
    written = (replace(task.parameters[0], written=20.0), task.parameters[1])
    case = search_case(campaign, replace(task, parameters=written))
    (found,) = told(folder, check_search(case))
    assert "s: the scenario as written makes no run" in found


def test_inequalities_that_leave_nothing_are_an_error(folder):
    both = "[doors_moving.closes > doors_moving.opens, doors_moving.closes < doors_moving.opens]"
    found = said(folder, OVER.format("4 .. 15 s", "13 .. 20 s") + f"    such that: {both}\n")
    assert (
        f"tiny.yaml:{LINE + 2}:5: s: no point of the ranges keeps to all of such that" in found[0]
    )


def test_a_scenario_that_does_not_keep_to_an_inequality_is_a_warning(folder):
    late = "    such that: doors_moving.closes > 9 s\n"
    (found,) = said(folder, OVER.format("4 .. 10 s", "12 .. 20 s") + late)
    assert "warning: s: the scenario as written does not keep to such that" in found


def test_what_is_written_as_a_method_never_becomes_the_hint(folder):
    campaign = load(folder, OVER.format("4 .. 10 s", "12 .. 20 s"))
    (task,) = campaign.searches
    found, *_ = told(folder, check_search(search_case(campaign, replace(task, method="a; tpe"))))
    assert 's: there is no method "a; tpe"\n    did you mean "tpe"?' in found


def test_a_method_that_does_not_fit_is_told(folder):
    rest = OVER.format("4 .. 10 s", "12 .. 20 s") + "      doors_moving.swing: 50 .. 70 deg/s\n"
    campaign = load(folder, rest)
    (task,) = campaign.searches
    case = search_case(campaign, replace(task, method="boundary"))
    (found,) = told(folder, check_search(case))
    assert found.startswith(f"tiny.yaml:{LINE - 2}:5: s: the method boundary takes one or two")


def test_checking_a_campaign_file_tries_its_searches(folder):
    load(folder, OVER.format("4 .. 15 s", "13 .. 20 s"))
    title, found = check_file(folder / "tiny.yaml")
    assert title == "1 scenario, 1 run, 1 search"
    assert [one.message for one in found if "makes no run" in one.message]
