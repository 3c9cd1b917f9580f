"""Which run is meant by what people write."""

import shutil
from pathlib import Path

import pytest

from daemon.analysis.blame import find_run
from daemon.batch.paths import StatePaths
from daemon.campaign import expand, load_campaign
from daemon.run import execute
from tests.daemon.analysis.blame.cases import CAMPAIGN, write


@pytest.fixture
def places(tmp_path):
    return StatePaths(tmp_path / "state")


def test_a_place_in_a_campaign_file(places):
    meant = find_run(["c.yaml", "S1", "pilot", "3"], places)
    assert (meant.campaign, meant.scenario, meant.sut, meant.repeat) == (
        Path("c.yaml"),
        "S1",
        "pilot",
        3,
    )
    assert find_run(["c.yaml", "S1"], places).sut == ""
    assert find_run(["c.yaml", "S1", "pilot"], places).repeat == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["c.yaml"], "SCENARIO SUT REPEAT"),
        (["c.yaml", "S1", "pilot", "-1"], "count from 0"),
        (["nothing"], "no campaign or run"),
        (["a.mcap", "S1"], "or CAMPAIGN.yaml SCENARIO"),
    ],
)
def test_what_names_no_run_is_refused(places, words, message):
    with pytest.raises(ValueError, match=message):
        find_run(words, places)


def test_a_trace_is_of_the_campaign_file_that_specifies_it(folder, places, monkeypatch):
    file = write(folder, CAMPAIGN.replace("16 s", "1 s"))
    planned = expand(load_campaign(file))
    execute(planned.specs[1], planned.scenes[0], trace_path=folder / "run.mcap")
    monkeypatch.chdir(folder.parent)
    meant = find_run(["demo/run.mcap"], places)
    assert meant.campaign.resolve() == file
    assert (meant.scenario, meant.sut, meant.repeat, meant.note) == ("rude", "pilot", 1, "")

    file.write_text(file.read_text().replace("near: 1 m", "near: 99 cm"))
    with pytest.raises(ValueError, match="does not specify this run any more.*--campaign"):
        find_run(["demo/run.mcap"], places)
    assert "layers have changed" in find_run(["demo/run.mcap"], places, file).note

    file.unlink()
    with pytest.raises(ValueError, match="no campaign file tiny"):
        find_run(["demo/run.mcap"], places)


def test_a_copy_of_the_campaign_among_results_gives_way_to_the_original(
    folder, places, tmp_path, monkeypatch
):
    original = write(folder, CAMPAIGN.replace("16 s", "1 s"))
    planned = expand(load_campaign(original))
    # As a search leaves it: after the alphabet the copy comes before the original in tests/.
    results = tmp_path / "scenario-results" / "search"
    for name in ("demo", "robots", "suts"):
        shutil.copytree(tmp_path / name, results / name)
    copy = results / "demo" / "tiny.yaml"
    (tmp_path / "demo").rename(tmp_path / "tests")
    trace = tmp_path / "run.mcap"
    execute(planned.specs[0], planned.scenes[0], trace_path=trace)
    monkeypatch.chdir(tmp_path)
    meant = find_run(["run.mcap"], places)
    assert (meant.campaign, meant.note) == (Path("tests/tiny.yaml"), "")

    original = tmp_path / "tests" / "tiny.yaml"
    original.write_text(original.read_text().replace("near: 1 m", "near: 99 cm"))
    meant = find_run(["run.mcap"], places)
    assert meant.campaign.resolve() == copy
    assert meant.note == f"its layers are read from the copy {meant.campaign}"
