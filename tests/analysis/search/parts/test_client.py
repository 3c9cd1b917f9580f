"""Searches in processes: the same runs whoever is killed, and an end that people hear of."""

import json
import subprocess
import sys

import pytest

from daemon.batch.errors import Refused
from daemon.model.search_answer import SearchProgress, SearchRow
from daemon.model.verbs import EXTEND, PROGRESS, SEARCHES
from daemon.search.client import DaemonRuns
from grammars.text.diagnostics import InputError, Where
from tests.analysis.search import fake_search
from tests.analysis.search.fake_search import CONFIRMED, client_of, result_of
from tests.analysis.search.searches import LocalRuns
from tests.analysis.search.tasks import mixed, mixed_task, searched
from tests.make import TASK, make_extension, make_search
from tests.parts import ROOT, daemon_at, eventually

RUNS = 30


def searching(state, slots=1):
    return daemon_at(state, slots, executor="tests.analysis.search.fake_search:execute")


@pytest.fixture(scope="module")
def undisturbed():
    """Positions and digests of the runs of a search, without any daemon."""
    runs = LocalRuns(lambda ones: [result_of(one.spec, leads=True) for one in ones])
    fake_search.search(make_search("s", runs=RUNS).task, runs)
    assert len(runs.digests) == RUNS + CONFIRMED
    assert TASK.window == 8
    return list(enumerate(runs.digests))


@pytest.fixture(scope="module")
def daemon(tmp_path_factory):
    with searching(tmp_path_factory.mktemp("searching") / "state", slots=4) as part, part.client():
        yield part


@pytest.fixture
def asked(daemon):
    """A connection to the daemon."""
    with daemon.client() as client:
        yield client


def run(daemon, campaign, runs=RUNS, **more):
    client = client_of(daemon.endpoint, campaign, runs, **more)
    client.start()
    return client


def finish(client):
    """Wait until the client of a search has ended."""
    eventually(lambda: not client.is_alive())


def leave(client):
    """Let a search wait for another client, however long the last question takes."""
    client.leave()
    finish(client)


@pytest.fixture
def gated(daemon, asked, tmp_path):
    """Begin a search whose runs wait for the gate: ``begin(campaign)`` and the gate."""
    gate = tmp_path / "gate"

    def begin(campaign, **more):
        client = run(daemon, campaign, 12, until=str(gate), **more)
        eventually(lambda: len(asked.all_runs(campaign, results=True)) == TASK.window)
        return client

    yield begin, gate
    gate.touch()


def digests(client):
    return [(row.proposal.position, row.digest) for row in client.all_runs("s", results=True)]


def finished(client, campaign, runs):
    (row,) = client.searches(campaign)
    return (row.state, row.proposed, row.finished) == ("finished", runs, runs)


def test_a_search_goes_on_with_the_same_runs_whatever_is_killed(tmp_path, undisturbed):
    with searching(tmp_path / "state") as part:
        part.client().close()
        command = [sys.executable, "-m", "tests.analysis.search.fake_search"]
        process = subprocess.Popen([*command, part.endpoint, "s", f"{RUNS}"], cwd=ROOT)
        with part.client() as daemon:
            eventually(daemon.campaigns)
            eventually(lambda: daemon.campaign("s").done >= 10)
        process.kill()
        process.wait()
        client = run(part, "s")
        with part.client() as daemon:
            eventually(lambda: daemon.campaign("s").done >= 20)
        part.kill()
        part.restart()
        finish(client)
        with part.client() as daemon:
            assert finished(daemon, "s", RUNS + CONFIRMED)
            assert digests(daemon) == undisturbed
            assert {row.state for row in daemon.all_runs("s", results=True)} == {"done"}


def test_the_runs_of_a_search_do_not_depend_on_the_number_of_workers(daemon, asked, undisturbed):
    finish(run(daemon, "s"))
    assert finished(asked, "s", RUNS + CONFIRMED)
    (row,) = asked.searches("s")
    assert digests(asked) == undisturbed
    assert (row.answer.ended, row.answer.explored) == ("budget", RUNS)
    assert all(one.leads and one.trace for one in asked.all_runs("s", results=True))
    assert asked.campaign("s").finished_at is not None
    # Asked for once more, its answer is there.
    finish(run(daemon, "s"))
    assert asked.searches("s") == (row,)


def test_a_search_that_is_cancelled_ends_and_goes_on_where_it_was(daemon, asked, gated):
    begin, gate = gated
    client = begin("halted")
    assert asked.campaign("halted").search == "running"
    assert asked.cancel("halted") == TASK.window
    finish(client)
    assert asked.searches("halted")[0].state == "cancelled"
    gate.touch()
    finish(run(daemon, "halted", 12, until=str(gate)))
    assert finished(asked, "halted", 12 + CONFIRMED)


def test_a_search_that_is_left_waits_for_another_client(daemon, asked, gated):
    begin, gate = gated
    first, second = begin("left", name="first"), begin("left", name="second")
    # One client at a time: the second waits, and nobody else adds to the search.
    for verb, request in (
        (EXTEND, make_extension("left", TASK.window, client="third")),
        (PROGRESS, SearchProgress("left", "third", "explore")),
    ):
        with pytest.raises(Refused, match="first makes the proposals of left"):
            asked.ask(verb, request)
    assert asked.searches("left")[0].client == "first"
    leave(first)
    eventually(lambda: asked.searches("left")[0].client == "second")
    leave(second)
    (row,) = asked.searches("left")
    assert (row.state, row.client, asked.campaign("left").search) == ("waiting", "", "waiting")
    with pytest.raises(Refused, match="unfinished search: cancel it first"):
        asked.delete(("left",))
    gate.touch()
    finish(run(daemon, "left", 12, until=str(gate)))
    assert asked.searches("left")[0].state == "finished"


def test_a_search_that_is_deleted_ends_its_client(asked, gated):
    begin, _ = gated
    client = begin("gone")
    asked.cancel("gone")
    asked.delete(("gone",))
    finish(client)
    assert asked.searches("gone") == ()


def test_a_search_that_proposes_otherwise_than_before_fails(daemon, asked, gated):
    begin, gate = gated
    leave(begin("changed"))
    finish(run(daemon, "changed", 12, learnt="otherwise", until=str(gate)))
    (row,) = asked.searches("changed")
    assert row.state == "failed"
    assert "run 0 of the search differs from the recorded one" in row.note
    gate.touch()
    eventually(lambda: asked.campaign("changed").done == TASK.window)


def broken(task, runs):
    raise RuntimeError("no such thing")


def narrow(task, runs):
    raise InputError.at(Where("campaign.yaml", 3), "too narrow")


def test_the_end_of_a_search_that_breaks_is_told(daemon, asked, capsys):
    for name, program in (("broken", broken), ("narrow", narrow)):
        finish(run(daemon, name, program=program))
    rows = {row.campaign: row for row in asked.searches()}
    assert (rows["broken"].state, rows["narrow"].state) == ("failed", "failed")
    assert rows["broken"].note == "the search broke: RuntimeError: no such thing"
    assert "campaign.yaml:3: too narrow" in rows["narrow"].note
    assert "RuntimeError: no such thing" in capsys.readouterr().err


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


def test_another_process_proposes_the_same_and_loads_optuna_only_where_it_guides():
    """Hashes of words, and with them the order of sets, differ between processes."""
    code = [
        "import json, sys",
        "from tests.analysis.search.tasks import make_task, mixed, mixed_task, ranged, searched",
        "for method in ('halton', 'random', 'boundary'):",
        "    searched(make_task(ranged(), method=method), lambda p: p[0] - 3.0, 30)",
        "assert 'optuna' not in sys.modules",
        "print(json.dumps([p.values for p, _ in searched(mixed_task(), mixed, 30)]))",
    ]
    command = [sys.executable, "-c", "\n".join(code)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    here = [list(proposal.values) for proposal, _ in searched(mixed_task(), mixed, 30)]
    assert json.loads(done.stdout) == here
