"""Campaigns through the public face: what they run, what is selected of them, their worlds."""

import shutil
from pathlib import Path

import pytest

from grammars.text.diagnostics import InputError
from scenario_tui import check, load
from scenario_tui.library import execution

CAMPAIGNS = Path("campaigns").absolute()
DEMO = CAMPAIGNS / "demo" / "campaign.yaml"


@pytest.fixture(scope="module")
def demo():
    return load(DEMO)


def test_a_campaign_says_what_it_runs(demo):
    assert (demo.path, demo.name, demo.runs) == (DEMO, "demo", 15)
    assert demo.scenarios == ("open-house", "busy-house", "rude-house")
    assert (demo.systems, demo.searches) == (("pilot",), ("doors-in-time",))
    assert demo.check() == []
    assert repr(demo) == "Campaign('demo', 3 scenarios, 15 runs)"


def test_a_selection_runs_what_the_whole_campaign_would(demo):
    whole, selected = demo.submission(), demo.select("busy-house", "pilot").submission()
    busy = [d for d, spec in zip(whole.digests, whole.specs, strict=True)
            if spec.scenario == "busy-house"]  # fmt: skip
    assert list(selected.digests) == busy
    assert [run.seed for run in selected.runs] == [run.seed for run in whole.runs[:5]]


def test_a_selection_compares_only_what_it_has():
    whole = load(CAMPAIGNS / "ortega2024" / "swinging_doors.yaml")
    first = whole.checked.declared.comparisons[0]
    both = whole.select().checked.declared.comparisons
    assert first in both
    assert first not in whole.select(first.left).checked.declared.comparisons


@pytest.mark.parametrize("where", ["name", "path"])
def test_another_system_takes_the_place_of_those_of_the_campaign(demo, where, monkeypatch):
    monkeypatch.chdir(CAMPAIGNS / "suts")
    other = demo.select("rude-house", "a2s" if where == "name" else "a2s.yaml")
    assert (other.scenarios, other.systems, other.runs) == (("rude-house",), ("a2s",), 5)
    assert not any(one.severity == "error" for one in other.check())
    seeds = [run.seed for run in demo.select("rude-house").submission().runs]
    assert [run.seed for run in other.submission().runs] == seeds
    again = demo.select("rude-house").select(system="a2s.yaml" if where == "path" else "a2s")
    assert (again.scenarios, again.runs) == (("rude-house",), 5)


@pytest.mark.parametrize("words", [{"scenario": "bussy-house"}, {"system": "pilott"}])
def test_unknown_names_are_answered_with_what_is_meant(demo, words):
    (name,) = words.values()
    with pytest.raises(InputError, match=f'no (scenario|system under test) "{name}"') as caught:
        demo.select(**words)
    assert caught.value.findings[0].hint in ('did you mean "busy-house"?', 'did you mean "pilot"?')


def test_a_campaign_with_errors_is_loaded_and_checked_and_never_run(tmp_path):
    for part in ("demo", "robots", "suts"):
        shutil.copytree(CAMPAIGNS / part, tmp_path / part)
    mission = tmp_path / "demo" / "courier.mission.yaml"
    text = mission.read_text()
    mission.write_text(text.replace("x: ", "x: 9", 1))
    campaign = load(tmp_path / "demo" / "campaign.yaml")
    wrong = [one for one in campaign.check() if one.severity == "error"]
    assert wrong
    assert wrong[0].where.file.endswith("courier.mission.yaml")
    with pytest.raises(InputError) as caught:
        campaign.submission()
    assert set(wrong) <= set(caught.value.findings)


def test_a_file_that_is_no_campaign_is_checked_all_the_same(tmp_path):
    assert check(DEMO.parent / "flat.fpm") == []
    (finding,) = check(tmp_path / "nothing.fpm")
    assert "nothing.fpm" in str(finding)
    with pytest.raises(InputError) as caught:
        load(tmp_path / "nothing.yaml")
    assert caught.value.__cause__ is None, "a chain of internals"


def test_a_scene_is_drawn(demo):
    scene = demo.scene("busy-house")
    assert "kitchen" in scene.spaces
    assert "kitchen_door" in scene.objects
    assert "<svg" in scene._repr_svg_()


def test_traces_of_a_killed_run_move_out_before_the_next_one(tmp_path):
    with execution._temporary_state(tmp_path) as state:
        folder = state / "traces" / "demo-1"
        folder.mkdir(parents=True)
        (folder / "a.mcap").touch()
        with execution._temporary_state(tmp_path):
            assert (folder / "a.mcap").is_file()  # its run is alive
        killed = tmp_path / ".scenario-killed"
        shutil.copytree(state, killed)
    (tmp_path / "a.mcap").unlink()
    with execution._temporary_state(tmp_path) as state:
        assert sorted(tmp_path.iterdir()) == [state, tmp_path / "a.mcap"]
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_no_worker_at_all_is_refused(demo, tmp_path):
    with pytest.raises(InputError, match="workers: 0 run nothing"):
        demo.run(workers=0, out=tmp_path)
    assert not list(tmp_path.glob(".scenario-*"))
