"""Searches that clients run: the same runs whoever is killed, and an end that people hear of."""

import subprocess
import sys
from dataclasses import replace

import pytest

from daemon.batch.errors import Refused
from daemon.model.proposals import ExtendRequest
from daemon.model.search_answer import SearchProgress, SearchRow
from daemon.model.verbs import EXTEND, PROGRESS, SEARCHES
from daemon.search.daemon_runs import DaemonRuns
from grammars.text.diagnostics import InputError, Where
from tests.analysis.search import fake_search
from tests.analysis.search.fake_search import CONFIRMED, client_of, result_of
from tests.analysis.search.local_runs import LocalRuns
from tests.make import TASK, make_extension, make_search, make_submission
from tests.parts import ROOT, daemon_at, eventually

RUNS = 30


def searching(state, slots=1):
    return daemon_at(state, slots, executor="tests.analysis.search.fake_search:execute")


@pytest.fixture(scope="module")
def undisturbed():
    """Positions and digests of the runs of a search, without any daemon."""
    runs = LocalRuns(executor=lambda ones: [result_of(one.spec, leads=True) for one in ones])
    fake_search.search(make_search("s", runs=RUNS).task, runs)
    assert len(runs.digests) == RUNS + CONFIRMED
    assert TASK.window == 8
    return list(enumerate(runs.digests))


@pytest.fixture(scope="module")
def daemon(tmp_path_factory):
    with searching(tmp_path_factory.mktemp("searching") / "state", slots=4) as part, part.client():
        yield part


def run(daemon, campaign, runs=RUNS, **asked):
    client = client_of(daemon.endpoint, campaign, runs, **asked)
    client.start()
    return client


def digests(daemon, campaign="s"):
    return [(row.proposal.position, row.digest) for row in daemon.all_runs(campaign, results=True)]


def settled(daemon, campaign="s"):
    return daemon.campaign(campaign).done


def test_a_search_goes_on_with_the_same_runs_whatever_is_killed(tmp_path, undisturbed):
    with searching(tmp_path / "state") as part:
        part.client().close()
        for count in (10, 20):
            command = [sys.executable, "-m", "tests.analysis.search.fake_search"]
            process = subprocess.Popen([*command, part.endpoint, "s", f"{RUNS}"], cwd=ROOT)
            with part.client() as daemon:
                eventually(lambda count=count, daemon=daemon: daemon.campaigns())
                eventually(lambda count=count, daemon=daemon: settled(daemon) >= count)
            process.kill()
            process.wait()
        client = run(part, "s")
        with part.client() as daemon:
            eventually(lambda: settled(daemon) >= 25)
        part.kill()
        part.restart()
        eventually(lambda: not client.is_alive())
        with part.client() as daemon:
            (row,) = daemon.searches()
            assert (row.state, row.proposed, row.finished) == ("finished", RUNS + 2, RUNS + 2)
            assert digests(daemon) == undisturbed
            assert {row.state for row in daemon.all_runs("s", results=True)} == {"done"}


def test_the_runs_of_a_search_do_not_depend_on_how_many_workers_there_are(daemon, undisturbed):
    client = run(daemon, "s")
    client.join(30.0)
    with daemon.client() as asked:
        (row,) = asked.searches("s")
        assert (row.state, row.proposed, row.finished) == ("finished", RUNS + 2, RUNS + 2)
        assert digests(asked) == undisturbed
        assert (row.answer.ended, row.answer.explored) == ("budget", RUNS)
        assert all(one.leads and one.trace for one in asked.all_runs("s", results=True))
        assert asked.campaign("s").finished_at is not None
        # Asked for once more, its answer is there.
        again = run(daemon, "s")
        again.join(30.0)
        assert asked.searches("s") == (row,)


def test_a_search_that_is_cancelled_ends_and_goes_on_where_it_was(daemon, tmp_path):
    gate = tmp_path / "gate"
    client = run(daemon, "halted", 12, until=str(gate))
    with daemon.client() as asked:
        eventually(lambda: len(asked.all_runs("halted", results=True)) == TASK.window)
        assert asked.campaign("halted").search == "running"
        assert asked.cancel("halted") == TASK.window
        client.join(30.0)
        assert asked.searches("halted")[0].state == "cancelled"
        gate.touch()
        run(daemon, "halted", 12, until=str(gate)).join(30.0)
        (row,) = asked.searches("halted")
        assert (row.state, row.proposed, row.finished) == ("finished", 14, 14)


def test_a_search_that_is_left_waits_for_another_client(daemon, tmp_path):
    gate = tmp_path / "gate"
    first = run(daemon, "left", 12, until=str(gate), name="first")
    with daemon.client() as asked:
        eventually(lambda: len(asked.all_runs("left", results=True)) == TASK.window)
        second = run(daemon, "left", 12, until=str(gate), name="second")
        # One client at a time: the second waits, and nobody else adds to the search.
        request = make_extension("left", TASK.window, client="third")
        with pytest.raises(Refused, match="first makes the proposals of left"):
            asked.ask(EXTEND, request)
        with pytest.raises(Refused, match="first makes the proposals of left"):
            asked.ask(PROGRESS, SearchProgress("left", "third", "explore"))
        assert asked.searches("left")[0].client == "first"
        first.leave()
        assert not first.is_alive()
        eventually(lambda: asked.searches("left")[0].client == "second")
        second.leave()
        (row,) = asked.searches("left")
        assert (row.state, row.client) == ("waiting", "")
        assert asked.campaign("left").search == "waiting"
        with pytest.raises(Refused, match="goes on: cancel it first"):
            asked.delete(("left",))
        gate.touch()
        run(daemon, "left", 12, until=str(gate)).join(30.0)
        assert asked.searches("left")[0].state == "finished"


def test_a_search_that_is_deleted_ends_its_client(daemon, tmp_path):
    gate = tmp_path / "gate"
    client = run(daemon, "gone", 12, until=str(gate))
    with daemon.client() as asked:
        eventually(lambda: len(asked.all_runs("gone", results=True)) == TASK.window)
        asked.cancel("gone")
        asked.delete(("gone",))
        client.join(30.0)
        assert not client.is_alive()
        assert asked.searches("gone") == ()
    gate.touch()


def broken(task, runs):
    raise RuntimeError("no such thing")


def narrow(task, runs):
    raise InputError.at(Where("campaign.yaml", 3), "too narrow")


def test_what_ends_a_search_is_told(daemon, capsys):
    for name, program in (("broken", broken), ("narrow", narrow)):
        run(daemon, name, program=program).join(30.0)
    with daemon.client() as asked:
        rows = {row.campaign: row for row in asked.searches()}
    assert (rows["broken"].state, rows["narrow"].state) == ("failed", "failed")
    assert rows["broken"].note == "the search broke: RuntimeError: no such thing"
    assert "campaign.yaml:3: too narrow" in rows["narrow"].note
    assert "RuntimeError: no such thing" in capsys.readouterr().err


def test_a_search_that_proposes_otherwise_than_before_fails(daemon, tmp_path):
    gate = tmp_path / "gate"
    client = run(daemon, "changed", until=str(gate))
    with daemon.client() as asked:
        eventually(lambda: len(asked.all_runs("changed", results=True)) == TASK.window)
        client.leave()
        run(daemon, "changed", learnt="otherwise", until=str(gate)).join(30.0)
        (row,) = asked.searches("changed")
        assert row.state == "failed"
        assert "run 0 of the search is another one than it was before" in row.note
        gate.touch()
        eventually(lambda: settled(asked, "changed") == TASK.window)


def test_a_daemon_that_has_forgotten_the_client_hears_of_it_again():
    """A daemon that was started anew, say, and has cleared away a scene as well."""

    class ForgetfulDaemon:
        asked = ()

        def send_files(self, runs):
            pass

        def ask(self, verb, request):
            self.asked += (verb,)
            if verb is SEARCHES:
                return (SearchRow("s", "s", 0.0, TASK, "waiting"),)
            if self.asked == (EXTEND,):
                raise Refused("there is no scene of that digest")
            return None

    daemon = ForgetfulDaemon()
    fake_search.issue(TASK, DaemonRuns(daemon, "s", "lab", 0.0), 0, 0, 0, "", {})
    assert daemon.asked == (EXTEND, SEARCHES, EXTEND)


def test_requests_of_clients_are_held_to_the_search(daemon):
    with daemon.client() as asked:
        asked.submit(make_submission("plain", 1, value=50.0))
        for wrong in (
            lambda: asked.ask(EXTEND, make_extension("plain", 1)),
            lambda: asked.ask(PROGRESS, SearchProgress("plain", "lab", "explore")),
        ):
            with pytest.raises(Refused, match="no search"):
                wrong()
        with pytest.raises(Refused, match="not a campaign id"):
            asked.begin_search(replace(make_search("s"), campaign="../s"))
        good = make_extension("t", 0, 2)
        asked.begin_search(make_search("t"))
        with pytest.raises(Refused, match="2 runs for 1 proposals"):
            asked.ask(EXTEND, ExtendRequest("lab", good.proposals[:1], good.runs))
