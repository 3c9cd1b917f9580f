"""What is handed to the daemon: a search that was checked, under an id made of its content."""

import shutil
from dataclasses import replace

import pytest

from daemon.model.search_answer import SearchRow
from daemon.search.preparation import prepare_search
from grammars.text.diagnostics import InputError

SEARCHES = """
search:
  early:
    scenario: open-house
    minimise: keeps-clear
    method: halton
    over: {pilot.max_speed: 0.3 .. 0.5}
"""
SECOND = """\
  late:
    scenario: open-house
    minimise: in-time
    method: halton
    over: {mission.start.y: -0.2 .. 0.2 m}
"""


@pytest.fixture
def file(tmp_path, campaigns):
    for part in ("demo", "robots", "suts"):
        shutil.copytree(campaigns / part, tmp_path / part)
    path = tmp_path / "demo" / "campaign.yaml"
    text = path.read_text()
    path.write_text(text[: text.index("  busy-house:")] + SEARCHES)
    return path


def test_the_same_search_has_the_same_id(file):
    found, _, warnings = prepare_search(file)
    assert warnings == ()
    assert found.name == "demo-early"
    assert found.campaign.startswith("demo-early-")
    assert prepare_search(file, "early")[0] == found


def test_other_values_are_another_search(file):
    ids = {
        prepare_search(file)[0].campaign,
        prepare_search(file, change=lambda task: replace(task, seed=8))[0].campaign,
        prepare_search(file, change=lambda task: replace(task, runs=61))[0].campaign,
        prepare_search(file, fresh=True)[0].campaign,
        prepare_search(file, fresh=True)[0].campaign,
    }
    assert len(ids) == 5


def test_where_its_files_lie_does_not_matter_what_they_say_does(file, tmp_path):
    before = prepare_search(file)[0].campaign
    moved = tmp_path / "elsewhere"
    shutil.copytree(tmp_path, moved, ignore=shutil.ignore_patterns("elsewhere"))
    assert prepare_search(moved / "demo" / "campaign.yaml")[0].campaign == before
    mission = moved / "demo" / "courier.mission.yaml"
    mission.write_text(mission.read_text() + "# another one\n")
    assert prepare_search(moved / "demo" / "campaign.yaml")[0].campaign != before


def test_which_search_is_meant_is_asked_for(file):
    file.write_text(file.read_text() + SECOND)
    with pytest.raises(InputError, match=r"several searches\n.*early, late"):
        prepare_search(file)
    with pytest.raises(InputError, match=r'no search "lat"\n.*late'):
        prepare_search(file, "lat")
    assert prepare_search(file, "late")[0].task.name == "late"


def test_a_campaign_without_searches_is_told_how_one_is_written(file):
    file.write_text(file.read_text().replace(SEARCHES, ""))
    with pytest.raises(InputError, match="has no searches"):
        prepare_search(file)


def test_what_was_changed_is_checked_as_well(file):
    with pytest.raises(InputError, match="nonsense"):
        prepare_search(file, change=lambda task: replace(task, method="nonsense"))


def test_nothing_is_handed_over_of_a_campaign_that_is_wrong(file):
    file.write_text(file.read_text().replace("minimise: keeps-clear", "minimise: nothing"))
    with pytest.raises(InputError, match="nothing"):
        prepare_search(file)


def test_a_known_search_goes_on_by_its_id_as_it_was_asked_for(file):
    asked = prepare_search(file, change=lambda task: replace(task, seed=8)).submission
    row = SearchRow(asked.campaign, asked.name, 0.0, asked.task, "waiting")
    again = prepare_search(file, asked.campaign, find={row.campaign: row}.get)
    assert again.submission == asked
