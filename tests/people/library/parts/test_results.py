"""Results through the public face: of a campaign run here, of its folder, of a daemon."""

import contextlib
import io
import re
from contextlib import redirect_stderr, redirect_stdout

import numpy as np
import pytest

import scenario_tui as st
from tests.people.cli.real import short_demo


@pytest.fixture(scope="module")
def campaign(tmp_path_factory, campaigns):
    """The demo cut down to two short runs, which end before the robot is home."""
    folder = short_demo(tmp_path_factory.mktemp("face"), campaigns)
    return st.load(folder / "campaigns" / "demo" / "campaign.yaml")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("place")


@pytest.fixture(scope="module")
def results(campaign, place):
    with contextlib.chdir(place), redirect_stdout(io.StringIO()) as out:
        with redirect_stderr(out):
            results = campaign.run(workers=1, out="traces")
        assert out.getvalue() == ""
    return results


def test_running_leaves_only_traces(results, place):
    assert list(place.iterdir()) == [place / "traces"]
    names = {"campaign.json", *(run.trace.path.name for run in results.runs)}
    assert {path.name for path in (place / "traces").iterdir()} == names
    assert results.runs[0].id == "traces/open-house.pilot.0.mcap"


def test_a_cell_has_the_verdicts_of_its_worst_repeat(results):
    assert (results.name, results.finished, results.passed) == ("demo", True, False)
    assert any("reached" in line and "open-house" in line for line in results.unexpected)
    (cell,) = results.cells
    assert cell == results["open-house", "pilot"]
    assert [run.repeat for run in cell.runs] == [0, 1]
    assert cell.outcome is st.Outcome.FAIL
    worst = min(run.verdict("keeps-clear").margin for run in results.value.rows)
    verdict = cell["keeps-clear"]
    assert (verdict.margin, verdict.unit) == (worst, "m")
    assert 0.0 < verdict.moment < 20.0
    assert verdict.about
    assert cell["nearest"].outcome is st.Outcome.MEASURE


def test_unknown_cells_and_oracles_are_answered_with_what_is_meant(results):
    with pytest.raises(KeyError, match="did you mean .*open-house.*pilot"):
        results["open-hose", "pilot"]
    with pytest.raises(KeyError, match="no cell open-house: "):
        results["open-house"]
    with pytest.raises(KeyError, match=r'no verdict of keeps-cler: did you mean "keeps-clear"\?'):
        results["open-house", "pilot"]["keeps-cler"]


def test_a_run_has_its_trace_signals_and_picture(results):
    run = results.runs[1]
    assert (run.scenario, run.system, run.repeat) == ("open-house", "pilot", 1)
    assert run.replay_command == f"scenario replay {run.id}"
    clearance = run.trace.signal("clearance")
    assert clearance.unit == "m"
    assert clearance.time.shape == clearance.value.shape
    assert np.all(np.diff(clearance.time) > 0.0)
    assert run.trace.signal("contact").unit == "bool"
    least = float(clearance.value.min())
    verdict = run.trace.judge("always(clearance >= 0.1 m)")
    assert verdict.margin == pytest.approx(least - 0.1)
    assert {v.oracle: v.margin for v in run.trace.verdicts} == {
        v.oracle: v.margin for v in run.verdicts
    }
    assert "<svg" in run.picture()


@pytest.mark.parametrize(
    ("ask", "where", "hint"),
    [
        (lambda trace: trace.judge("always(clearence >= 0.1 m)"), "oracle:1:8", "clearance"),
        (lambda trace: trace.judge("always(kitchen_dor.angle > 1 rad)"), "oracle:1:8", "kitchen"),
        (lambda trace: trace.signal("clearence"), "signal clearence", "clearance"),
    ],
)
def test_a_wrong_oracle_or_signal_is_shown_where_it_is_wrong(results, ask, where, hint):
    with pytest.raises(st.InputError) as caught:
        ask(results.runs[0].trace)
    finding = caught.value.findings[0]
    assert str(finding.where) == where
    assert finding.hint.startswith(f'did you mean "{hint}')


def test_a_trace_that_is_none_is_an_input_error(results, tmp_path):
    with pytest.raises(st.InputError, match="a name is missing"):
        results.runs[0].trace.signal("")
    path = tmp_path / "run.mcap"
    path.write_bytes(b"nothing")
    with pytest.raises(st.InputError, match=r"run\.mcap"):
        st.Trace(path).signal("clearance")


def test_the_folder_has_the_same_results(results, place, monkeypatch):
    monkeypatch.chdir(place)
    again = st.results("traces")
    assert [run.id for run in again.runs] == [run.id for run in results.runs]
    assert [run.verdicts for run in again.runs] == [run.verdicts for run in results.runs]
    assert (again.passed, again.name) == (results.passed, "demo")
    assert len(again.unexpected) == len(results.unexpected)


def test_results_are_a_table_and_notebooks_show_what_the_terminal_says(results, campaign):
    assert results.to_arrow().num_rows == sum(len(run.verdicts) for run in results.runs)
    assert results.__arrow_c_stream__() is not None
    page = re.sub(r"<[^>]+>", "", results._repr_html_())
    assert "✗ fail 0/2" in page
    assert "not as expected" in page
    assert "2 runs" in re.sub(r"<[^>]+>", "", campaign._repr_html_())
