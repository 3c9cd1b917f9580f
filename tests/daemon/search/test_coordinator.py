"""Searches in a daemon: the same runs whoever is killed, and an end that people are told of."""

import json
import os
import shutil
import signal
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from daemon.batch.paths import StatePaths
from daemon.campaign import bundle_campaign, load_campaign
from daemon.model.bundles import unpack_bundle
from daemon.model.spec import LeadingMargin
from daemon.search.coordinator import run_program
from tests.daemon.batch.harness import daemon_at, eventually
from tests.daemon.batch.samples import TASK, make_result, make_search, make_submission
from tests.daemon.search.fake_search import CONFIRMED, LocalRuns, search

TINY = """\
campaign: tiny
limit: 3 min
robot: courier
oracles: [navigation]
matrix: {sut: [pilot]}
scenarios:
  busy:
    floorplan: flat
    objects: doors
    behaviours: doors_moving
    mission: courier
    oracles: [keeps-clear]
search:
  s:
    scenario: busy
    minimise: keeps-clear
    over: {doors_moving.swing: 40 .. 80 deg/s}
    budget: 3 runs
    method: halton
"""
FAKE = "tests.daemon.search.fake_search"
RUNS = 30


def searching(state, slots=1):
    return daemon_at(state, slots, executor=f"{FAKE}:execute", searcher=f"{FAKE}:search")


def sought(campaign, runs=RUNS, **asked):
    return make_search(campaign, {"campaign.yaml": json.dumps(asked)}, runs=runs)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Positions and digests of the runs of a search, without any daemon."""
    folder = tmp_path_factory.mktemp("undisturbed")
    (folder / "campaign.yaml").write_text("{}")
    runs = LocalRuns()
    search(folder, "campaign.yaml", make_search("s", runs=RUNS).task, runs)
    assert len(runs.digests) == RUNS + CONFIRMED
    assert TASK.window == 8
    return runs.digests


def digests(client, campaign="s"):
    return [(row.proposal.position, row.run.digest) for row in client.proposals(campaign)]


def ended(client, campaign="s"):
    def look():
        row = client.search_row(campaign)
        assert row is not None
        return None if row.state == "running" else row

    return eventually(look)


def coordinators(daemon):
    return [line["pid"] for line in daemon.noted("search coordinator started")]


def settled(client, campaign="s"):
    row = client.campaign(campaign)
    assert row is not None
    return row.done


def test_a_search_goes_on_with_the_same_runs_whatever_is_killed(tmp_path, undisturbed):
    with searching(tmp_path / "state") as daemon:
        with daemon.client() as client:
            client.submit_search(sought("s"))
            for count in (10, 20):
                eventually(lambda count=count: settled(client) >= count)
                os.kill(coordinators(daemon)[-1], signal.SIGKILL)
                known = len(coordinators(daemon))
                eventually(lambda known=known: len(coordinators(daemon)) > known)
            eventually(lambda: settled(client) >= 25)
            last = coordinators(daemon)[-1]
            daemon.kill()
        eventually(lambda: not psutil.pid_exists(last))
        daemon.restart()
        with daemon.client() as client:
            assert ended(client).state == "finished"
            assert digests(client) == undisturbed
            rows = client.proposals("s")
            assert {row.run.state for row in rows} == {"done"}
            client.submit_search(sought("t", parameters={"until": str(tmp_path / "gate")}))
            eventually(lambda: len(client.proposals("t")) == TASK.window)
            last = coordinators(daemon)[-1]
            assert os.getpriority(os.PRIO_PROCESS, last) == os.nice(0) + 5
            client.cancel("t")
            client.shutdown()
            assert daemon.wait() == 0
        assert not psutil.pid_exists(last)


@pytest.fixture(scope="module")
def daemon(tmp_path_factory):
    with searching(tmp_path_factory.mktemp("searching") / "state", slots=4) as part:
        yield part


def test_the_runs_of_a_search_do_not_depend_on_how_many_workers_there_are(daemon, undisturbed):
    with daemon.client() as client:
        client.submit(make_submission("plain", 1, value=50.0))
        eventually(lambda: settled(client, "plain"))
        assert coordinators(daemon) == []
        client.submit_search(sought("s", answer=20 * 2**20))
        row = ended(client)
        assert (row.state, row.proposed, row.finished) == ("finished", RUNS + 2, RUNS + 2)
        assert digests(client) == undisturbed
        assert row.answer is not None
        assert (row.answer.ended, row.answer.explored) == ("budget", RUNS)
        # Too large for the daemon: the answer is worth more than its files.
        assert row.answer.shrunk is not None
        assert row.answer.shrunk.files == ()
        assert "too large" in row.note
        assert all(found.run.leads and found.run.trace for found in client.proposals("s"))
        campaign = client.campaign("s")
        assert campaign is not None
        assert campaign.finished_at is not None
        # Nothing of it is left when no search runs.
        (pid,) = coordinators(daemon)
        eventually(lambda: not psutil.pid_exists(pid))
        assert [line["code"] for line in daemon.noted("search coordinator ended")] == [0]
        assert client.overview().troubles == ()


def test_a_search_that_is_cancelled_goes_on_where_it_was(daemon, tmp_path):
    gate = tmp_path / "gate"
    with daemon.client() as client:
        client.submit_search(sought("halted", 12, parameters={"until": str(gate)}))
        eventually(lambda: len(client.proposals("halted")) == TASK.window)
        client.pause("halted")
        assert client.cancel("halted") == TASK.window
        assert client.runs(campaign="halted", state="queued").total == 0
        client.resume("halted")
        eventually(lambda: not psutil.pid_exists(coordinators(daemon)[-1]))
        gate.touch()
        assert client.retry("halted") == TASK.window
        row = ended(client, "halted")
        assert (row.state, row.proposed, row.finished) == ("finished", 14, 14)
        client.delete(("halted",))


def test_a_search_that_is_deleted_and_submitted_again_begins_anew(daemon, tmp_path):
    gate = tmp_path / "gate"
    ended_before = len(daemon.noted("local worker ended"))
    with daemon.client() as client:
        client.submit_search(sought("anew", 12, parameters={"until": str(gate)}))
        eventually(lambda: len(client.proposals("anew")) == TASK.window)
        # What proposes learns of it when all is over.
        os.kill(coordinators(daemon)[-1], signal.SIGSTOP)
        client.cancel("anew")
        client.delete(("anew",))
        client.submit_search(sought("anew", 12, parameters={"until": str(gate)}))
        gate.touch()
        os.kill(coordinators(daemon)[-1], signal.SIGCONT)
        row = ended(client, "anew")
        assert (row.state, row.proposed, row.finished) == ("finished", 14, 14)
        assert len(daemon.noted("local worker ended")) == ended_before
        client.delete(("anew",))


def test_what_ends_a_search_is_told(daemon):
    with daemon.client() as client:
        client.submit_search(sought("broken", **{"raise": "no such thing"}))
        client.submit_search(sought("narrow", refuse="too narrow"))
        broken, narrow = ended(client, "broken"), ended(client, "narrow")
        assert (broken.state, narrow.state) == ("failed", "failed")
        assert "the search broke: RuntimeError: no such thing (search.log" in broken.note
        assert "campaign.yaml:3: too narrow" in narrow.note
        client.delete(("broken", "narrow"))
    assert "RuntimeError: no such thing" in StatePaths(daemon.state).search_log.read_text()


def test_a_search_that_proposes_otherwise_than_before_fails(daemon, tmp_path):
    gate = tmp_path / "gate"
    with daemon.client() as client:
        client.submit_search(sought("changed", count=True, parameters={"until": str(gate)}))
        eventually(lambda: len(client.proposals("changed")) == TASK.window)
        os.kill(coordinators(daemon)[-1], signal.SIGKILL)
        row = ended(client, "changed")
        assert row.state == "failed"
        assert "run 0 of the search is another one than it was before" in row.note
        gate.touch()
        eventually(lambda: settled(client, "changed") == TASK.window)
        client.delete(("changed",))


def test_a_search_is_given_up_that_ends_its_process_again_and_again(daemon):
    with daemon.client() as client:
        client.submit_search(sought("deadly", die=9))
        row = ended(client, "deadly")
        assert row.state == "failed"
        assert "what makes its proposals died 3 times in a row" in row.note
        assert row.proposed == 9
        campaign = client.campaign("deadly")
        assert campaign is not None
        assert campaign.finished


def keeping_clear(spec):
    lead = LeadingMargin("keeps-clear", 0.25, "m")
    return replace(make_result(spec), leads=(lead,))


def test_the_program_of_a_search_is_run_on_its_files(campaigns, tmp_path):
    own = Path(shutil.copytree(campaigns / "demo", tmp_path / "demo")) / "tiny.yaml"
    own.write_text(TINY)
    (task,) = load_campaign(own).searches
    name, files = bundle_campaign(own)
    folder = tmp_path / "unpacked"
    unpack_bundle(files, folder)
    shutil.rmtree(own.parent)
    runs = LocalRuns(keeping_clear)
    answer = run_program(folder, name, task, runs)
    assert (answer.ended, answer.explored, answer.failed) == ("budget", 3, 0)
    assert len({digest for _, digest in runs.digests}) == 3
