"""``scenario report``: what people type, what is written, what is said when it cannot be."""

import csv
import os
import re
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from PIL import Image

from daemon.batch.paths import StatePaths
from scenario_tui.cli import invoke
from tests.analysis.report.recordings import OPEN, SHUT, SUTS, record, spec
from tests.people.cli.outputs import declared
from tests.people.recorded import campaign_at


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A working folder with one folder of two traces in it, and no campaigns anywhere."""
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    for name, scenario in (("a", SHUT), ("b", OPEN)):
        record(tmp_path / "traces" / f"{name}.mcap", spec(scenario, SUTS[1], 0))
    return tmp_path


@pytest.fixture
def ledger(here):
    """A state directory with a campaign: two runs with results, one still waiting."""
    places = StatePaths(here / "state")
    campaign_at(places)
    return places


def test_tables_alone_need_no_page(here, capsys):
    arguments = ["--junit", "r.xml", "--table", "m.parquet"]
    assert invoke(["report", "traces", *arguments]) == 0
    assert {path.name for path in here.iterdir()} == {"traces", "r.xml", "m.parquet"}
    out = capsys.readouterr().out
    assert "Yes. All 6 verdicts are as expected." in out
    assert re.search(r"m\.parquet \([0-9.]+ kB\)", out)


def test_a_copy_of_a_trace_does_not_count_and_a_page_is_not_replaced_silently(here, capsys):
    (here / "traces" / "again").mkdir()
    shutil.copy(here / "traces" / "a.mcap", here / "traces" / "again")
    (here / "traces" / "b.mcap").rename(here / "traces" / "again" / "b.mcap")
    assert invoke(["results", "traces"]) == 0
    assert "2 traces in 2 folders\n" in capsys.readouterr().out
    for is_there in (False, True):
        assert invoke(["report", "traces", "-j", "1"]) == 0
        out, err = capsys.readouterr()
        assert "All 6 verdicts" in out
        assert "traces: 1 copy of a trace left out, each run counts once" in err
        assert ("report.html was there and is replaced" in err) == is_there


def test_results_of_every_source_can_be_a_table(ledger, capsys):
    assert invoke(["results", "corr", "--json"]) == 0
    Path("corr.json").write_text(capsys.readouterr().out)
    for name, campaign in (("corr", "corr-1"), ("corr.json", "corr.json"), ("traces", "traces")):
        assert invoke(["results", name, "--table", "t.csv"]) == 0
        said = capsys.readouterr()
        with Path("t.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert said.err == f"t.csv: {len(rows)} rows\n"
        assert {row["campaign"] for row in rows} == {campaign}
        assert {"buffer", "reached"} < {row["oracle"] for row in rows}


def test_a_campaign_of_the_ledger_needs_no_daemon(ledger, capsys):
    assert invoke(["report", "corr", "--table", "m.csv", "--json"]) == 0
    body = declared(capsys.readouterr().out)
    assert body["schema"] == "scenario/report/1"
    assert (body["campaign"], body["runs"], body["exit_code"]) == ("corr", 3, 1)
    assert body["written"] == {"table": "m.csv"}
    assert invoke(["report", "corr", "--table", "m.csv", "--exit-status"]) == 1


def test_the_newest_campaign_becomes_a_page_when_nothing_is_said(ledger):
    assert invoke(["report", "-j", "1", "--figures", "drawn"]) == 0
    assert Path("drawn/boxes-duration.pdf").read_bytes().startswith(b"%PDF")
    page = Path("report.html").read_text(encoding="utf-8")
    assert "scenario judge corr-1.1" in page
    assert "queued" in page


def test_one_run_is_drawn(ledger):
    for name in ("run.svg", "run.png", "run.pdf"):
        assert invoke(["export", "corr-1.0", "picture", "-o", name]) == 0
    text = Path("run.svg").read_text(encoding="utf-8")
    assert "inside the buffer" in text
    assert "1 contact" in text
    # It fails: what decides is in red.
    assert ET.fromstring(text).find(".//*[@id='mark']") is not None
    with Image.open("run.png") as picture:
        assert picture.size[0] > 500
    assert Path("run.pdf").read_bytes().startswith(b"%PDF-")
    part = ["--from", "4", "--until", "6.5", "-o", "part.svg"]
    assert invoke(["export", "corr-1.0", "picture", *part]) == 0
    assert "4.0 s to 6.5 s of 20.0 s" in Path("part.svg").read_text(encoding="utf-8")


def test_a_ledger_that_cannot_be_read_is_said(here, capsys):
    (here / "state").mkdir()
    (here / "state" / "ledger.db").write_bytes(b"not a database at all" * 100)
    assert invoke(["report"]) == 3
    assert "is not a usable ledger" in capsys.readouterr().err


def test_the_newest_folder_of_traces_is_meant_when_there_is_no_campaign(here, capsys):
    for number, name in enumerate(("new-2", "old-1")):
        note = here / "scenario-results" / name / "campaign.json"
        note.parent.mkdir(parents=True)
        note.write_text('{"name": "n", "about": "", "declared": {}}')
        os.utime(note, (1000.0 - number, 1000.0 - number))
        (note.parent / "a.mcap").symlink_to(here / "traces" / "a.mcap")
    assert invoke(["report", "--table", "m.csv"]) == 0
    assert "n (scenario-results/new-2): Yes." in capsys.readouterr().out
