"""Which run is meant by what people write."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.analysis.blame import find_case
from daemon.analysis.results import write_campaign_note
from daemon.batch.ledger import LedgerWriter
from daemon.batch.paths import StatePaths
from daemon.campaign import campaign_origin, expand, load_campaign
from daemon.run import execute
from tests.daemon.analysis.blame.cases import CAMPAIGN, write


@pytest.fixture
def places(tmp_path):
    return StatePaths(tmp_path / "state")


def label(found):
    case, note = found
    return Path(case.campaign.file), case.spec.label, note


@pytest.mark.parametrize("words", [["pilot", "1"], ["pilot"], []])
def test_a_place_in_a_campaign_file(folder, places, words):
    file = write(folder)
    repeat = words[1] if len(words) > 1 else 0
    found = find_case([str(file), "rude", *words], places)
    assert label(found) == (file, f"rude/pilot/{repeat}", "")


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
        find_case(words, places)


def test_a_trace_is_of_the_campaign_file_that_its_record_names(folder, places):
    file = write(folder, CAMPAIGN.replace("16 s", "1 s"))
    # As a search leaves it: a copy that specifies the same run.
    shutil.copytree(folder, folder.parent / "a_copy")
    campaign = load_campaign(file)
    planned = expand(campaign)
    trace = folder.parent / "results" / "run.mcap"
    trace.parent.mkdir()
    execute(planned.specs[1], planned.scenes[0], trace_path=trace)
    with pytest.raises(ValueError, match="no record names the campaign file.*--campaign"):
        find_case([str(trace)], places)
    write_campaign_note(trace.parent, replace(planned, origin=campaign_origin(campaign, file)))
    assert label(find_case([str(trace)], places)) == (file, "rude/pilot/1", "")

    file.write_text(file.read_text().replace("near: 1 m", "near: 99 cm"))
    with pytest.raises(ValueError, match="does not specify this run any more.*--campaign"):
        find_case([str(trace)], places)
    assert "layers have changed" in find_case([str(trace)], places, file)[1]

    file.unlink()
    with pytest.raises(ValueError, match="tiny.yaml any more: say --campaign FILE"):
        find_case([str(trace)], places)


def test_a_run_of_the_ledger_is_of_the_file_it_was_submitted_from(folder, places):
    file = write(folder, CAMPAIGN.replace("16 s", "1 s"))
    campaign = load_campaign(file)
    submission = replace(expand(campaign), origin=campaign_origin(campaign, file))
    places.state.mkdir()
    with LedgerWriter.open(places) as ledger:
        ledger.submit(submission, 0.0)
    trace = places.traces / submission.campaign / "rude.pilot.0.mcap"
    trace.parent.mkdir(parents=True)
    execute(submission.specs[0], submission.scenes[0], trace_path=trace)
    assert label(find_case([str(trace)], places)) == (file, "rude/pilot/0", "")


def test_a_repeat_in_reserve_is_a_run_like_others(folder, places):
    policy = "repeats: {n: 1, pass: rate >= 80 %, until: decided, at-most: 2}"
    text = CAMPAIGN.replace("16 s", "1 s").replace("repeats: 2", policy)
    file = write(folder, text)
    planned = expand(load_campaign(file))
    spec = planned.spec(planned.reserve[0])
    trace = folder / "rude.pilot.1.mcap"
    execute(spec, planned.scenes[0], trace_path=trace)
    case, _ = find_case([str(trace)], places, file)
    assert case.spec == spec
