"""The command line with nothing faked: real daemon, real worker, real traces."""

import json
import signal

import pytest

import scenario_tui as st
from scenario_tui.cli.answer import exit_code
from scenario_tui.library import execution
from tests.parts import eventually
from tests.people.cli.outputs import declared
from tests.people.cli.real import COMMAND, call_here, endless, short_demo
from tests.people.terminal.pseudo_terminal import terminal


@pytest.fixture(scope="module")
def place(tmp_path_factory, campaigns):
    """A folder with the demo campaign cut down to two short runs."""
    return short_demo(tmp_path_factory.mktemp("real"), campaigns)


@pytest.fixture(scope="module")
def finished(place):
    """A state directory with a daemon that has finished the campaign."""
    state = place / "state"
    file = str(place / "campaigns" / "demo" / "campaign.yaml")
    done = call_here("submit", file, "--watch", "--json", state=state, cwd=place)
    body = declared(done.stdout)
    assert done.returncode == exit_code(row["outcome"] for row in body["runs"]), done.stderr
    assert "started a daemon on this machine" in done.stderr
    yield state
    assert call_here("daemon", "--stop", state=state, cwd=place).returncode == 0


def test_results_are_kept_by_the_daemon(finished, place):
    done = call_here("results", "demo", state=finished, cwd=place)
    assert done.returncode == 0, done.stderr
    assert "open-house" in done.stdout
    assert "2 traces in" in done.stdout
    status = declared(call_here("status", "--json", state=finished, cwd=place).stdout)
    assert status["overview"]["done"] == 2


def test_a_trace_is_marked_by_the_ledger_that_keeps_it(finished, place):
    trace = min((finished / "traces").rglob("*.mcap"))
    assert "✗ fail !" in call_here("show", str(trace), state=place / "other", cwd=place).stdout
    (copy := place / "copy.mcap").write_bytes(trace.read_bytes())
    assert "✗ fail  " in call_here("show", str(copy), state=finished, cwd=place).stdout


def test_submitting_again_runs_nothing_twice(finished, place):
    file = str(place / "campaigns" / "demo" / "campaign.yaml")
    done = call_here("submit", file, state=finished, cwd=place)
    assert done.returncode == 0
    assert "exists already, its 2 runs are kept" in done.stderr


def test_what_has_a_result_is_not_run_again_unless_something_changed(finished, place):
    first = declared(call_here("results", "--json", state=finished, cwd=place).stdout)
    changed = place / "campaigns" / "demo" / "changed.yaml"
    text = (changed.parent / "campaign.yaml").read_text()
    changed.write_text(text.replace("repeats: 2", "repeats: 3") + "\n# one more repeat\n")
    before = place / "before.json"
    before.write_text(json.dumps(first))
    done = call_here(
        "submit", str(changed), "--watch", "--json", "--baseline", str(before), "--worse-by", "0",
        state=finished, cwd=place,
    )  # fmt: skip
    body = declared(done.stdout)
    assert "3 runs, 2 cached" in done.stderr
    assert body["campaign"]["cached"] == 2
    ids = [run["id"] for run in first["runs"]]
    assert [run["cached"] for run in body["runs"]] == [*ids, ""]
    assert body["runs"][0]["trace"] == first["runs"][0]["trace"]
    assert [run["result"]["verdicts"] for run in body["runs"][:2]] == [
        run["result"]["verdicts"] for run in first["runs"]
    ]
    assert all(shift["mean"] == 0.0 for shift in body["comparison"]["shifts"])
    assert done.returncode == body["assessment"]["exit_code"]


def test_runs_of_a_job_come_one_by_one(finished, place, monkeypatch):
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    campaign = st.load(place / "campaigns" / "demo" / "campaign.yaml")
    job = campaign.submit(state=finished, fresh=True)
    assert repr(job).startswith("Job('demo-")
    runs = list(job.results())
    assert sorted(run.id for run in runs) == [f"{job.id}.0", f"{job.id}.1"]
    assert all(run.outcome is st.Outcome.FAIL for run in runs)
    assert runs[0].trace.signal("speed").unit == "m/s"
    results = job.wait()
    assert (results.id, results.finished, job.cancel()) == (job.id, True, 0)
    assert [run.id for run in st.results("demo", state=finished).runs] == [
        run.id for run in results.runs
    ]


def test_a_state_directory_without_a_daemon_is_not_mixed_up(finished, place):
    done = call_here("status", "--state", str(place / "elsewhere"), state=finished, cwd=place)
    assert done.returncode == 3
    assert "no daemon keeps" in done.stderr


def test_the_dashboard_opens_in_a_terminal_and_leaves_without_stopping_work(finished, place):
    with terminal([*COMMAND, "tui"], environ={"SCENARIO_STATE": str(finished)}) as shown:
        shown.until("connected")
        # The mission takes longer than the limit of this campaign.
        shown.until(" unexpected")
        shown.type("m")
        shown.until("expected pass")
        shown.type("q")
        assert shown.wait() == 0
        assert "no run is waiting" in shown.text
        assert "Back with" in shown.text
    assert call_here("status", state=finished, cwd=place).returncode == 0


def test_a_run_told_to_end_leaves_no_workshop_behind(place, tmp_path, monkeypatch):
    file = endless(place / "campaigns" / "demo" / "campaign.yaml")

    def until_told(opened, runs, **_):
        with opened() as daemon:
            eventually(lambda: daemon.campaign(runs.campaign).running)
        signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(execution, "watch", until_told)
    done = call_here("run", str(file), "-o", str(tmp_path), state=place / "none", cwd=place)
    assert done.returncode == 130, done.stderr
    assert "interrupted" in done.stderr
    left = {path.name for path in tmp_path.iterdir()}
    assert "campaign.json" in left
    assert all(name.endswith(".mcap") for name in left - {"campaign.json"})
