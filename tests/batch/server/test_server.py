import concurrent.futures
import signal
import socket
from dataclasses import replace

import psutil
import pytest

from daemon.batch import bus
from daemon.batch.errors import Refused
from daemon.batch.ledger import LedgerWriter
from daemon.batch.operation import examine
from daemon.batch.paths import Endpoint, StatePaths
from daemon.model import verbs
from daemon.model.messages import ASK, OWNER, Completion, ErrorReply
from daemon.model.spec import ENGINE_VERSION
from grammars.text import codec
from tests.make import (
    SCENE,
    make_result,
    make_spec,
    make_submission,
    submission_of,
)
from tests.parts import Part, daemon_at, eventually


@pytest.fixture(scope="module")
def daemon(tmp_path_factory):
    with daemon_at(tmp_path_factory.mktemp("server") / "state") as part:
        part.client().close()  # it is up: some tests ask past the client
        yield part


@pytest.fixture
def client(daemon):
    with daemon.client() as connected:
        yield connected


def raw(daemon, key, payload):
    """Ask past the client; returns the daemon's complaint."""
    with bus.open_client(daemon.endpoint) as session:
        replies = list(session.get(key, payload=payload, timeout=60.0))
    assert len(replies) == 1
    assert replies[0].err is not None
    return codec.from_json(ErrorReply, replies[0].err.payload.to_bytes()).problem


def test_the_daemon_listens_once_and_on_loopback_only(daemon, client):
    sockets = psutil.Process(daemon.pid).net_connections("inet")
    listening = [s for s in sockets if s.status == psutil.CONN_LISTEN]
    assert [s.laddr.ip for s in listening] == ["127.0.0.1"]
    assert [s for s in sockets if s.type == socket.SOCK_DGRAM] == []
    assert client.overview().workers == 0


def test_a_submission_is_in_the_ledger_when_the_receipt_comes(client):
    submission = make_submission("whole", 4)
    receipt = client.submit(submission)
    assert (receipt.runs, receipt.known) == (4, False)
    assert client.submit(submission).known
    assert client.runs("whole").total == 4
    assert client.run("whole.2").spec == submission.specs[2]
    assert client.scene(SCENE.digest) == SCENE


def test_a_bad_submission_is_refused_as_a_whole_with_all_reasons(client):
    spec = make_spec()
    orphan = replace(make_spec(1), scene="0" * 64)
    endless = replace(make_spec(2), limit=-1.0)
    foreign = replace(make_spec(3), engine="0")
    with pytest.raises(Refused) as refusal:
        client.submit(submission_of("bad", spec, spec, orphan, endless, foreign))
    words = str(refusal.value)
    assert "S1/pilot/0 is there twice" in words
    assert "S1/pilot: its scene 000000000000 is neither here nor sent along" in words
    assert "S1/pilot: the limit must be" in words
    assert "S1/pilot: made for engine 0" in words
    assert client.runs("bad").total == 0


@pytest.mark.parametrize("name", ["../up", "a b", "", "x" * 200])
def test_a_campaign_id_must_be_one(client, name):
    with pytest.raises(Refused, match="not a campaign id"):
        client.submit(make_submission(name))


def test_names_of_scenarios_stay_inside_the_traces(client, daemon):
    client.submit(submission_of("names", make_spec(scenario="../../etc/passwd")))
    with pytest.raises(Refused, match="no usable file name"):
        client.submit(submission_of("names2", make_spec(scenario="x" * 300)))
    trace = (
        StatePaths(daemon.state).traces / "names" / "%2E%2E%2F%2E%2E%2Fetc%2Fpasswd.pilot.0.mcap"
    )
    assert client.run("names.0").row.trace == ""
    assert trace.parent.parent == StatePaths(daemon.state).traces


@pytest.mark.parametrize("payload", [b"", b"{", b"[]", b'{"id": 7}', b"\xff\xfe", b"[" * 10_000])
def test_malformed_requests_are_refused(daemon, payload):
    assert "malformed" in raw(daemon, f"{ASK}/{OWNER}/cancel", payload)


def test_oversized_requests_are_refused_unread(daemon):
    limit = verbs.RUN.largest
    complaint = raw(daemon, f"{ASK}/{OWNER}/run", b" " * (limit + 1))
    assert f"at most {limit}" in complaint


def test_unknown_verbs_are_refused(daemon):
    assert "does not know how to" in raw(daemon, f"{ASK}/{OWNER}/evaluate", b"{}")
    assert "does not know how to" in raw(daemon, f"{ASK}/{OWNER}/*", b"{}")


def test_questions_about_unknown_things_are_refused(client):
    for question in (
        lambda: client.run("no.1"),
        lambda: client.cancel("no"),
        lambda: client.retry("no"),
        lambda: client.scene("0" * 64),
        lambda: client.scene("../ledger"),
        lambda: client.retry("no", only="everything"),
    ):
        with pytest.raises(Refused):
            question()


def test_cancelled_runs_can_be_retried(client):
    client.submit(make_submission("again", 6))
    assert client.cancel("again") == 6
    assert client.cancel("again") == 0
    assert client.retry("again", only="lost") == 0
    assert client.retry("again") == 6
    row = next(row for row in client.campaigns() if row.id == "again")
    assert (row.queued, row.finished_at, row.finished) == (6, None, False)


def test_many_clients_ask_at_once(daemon, client):
    def campaign(number):
        client.submit(make_submission(f"many-{number}", 3))
        return client.runs(f"many-{number}").total

    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        assert list(pool.map(campaign, range(24))) == [3] * 24


def test_a_request_that_nobody_waits_for_does_no_harm(daemon, client):
    with bus.open_client(daemon.endpoint) as session:
        handler = session.get(f"{ASK}/{OWNER}/overview", payload=b"{}", timeout=1.0)
        del handler
    assert client.overview().state == str(daemon.state)


def test_a_second_daemon_on_the_directory_is_refused(daemon, tmp_path):
    options = ("--state", str(daemon.state), "--listen", "tcp/127.0.0.1:1", "--slots", "0")
    second = Part("serve", tmp_path / "second.log", *options)
    assert second.wait() == 4
    assert "a daemon already keeps" in second.output
    assert f"process {daemon.pid}" in second.output


def test_a_taken_port_is_named(daemon, tmp_path):
    options = ("--state", str(tmp_path / "other"), "--listen", daemon.endpoint, "--slots", "0")
    second = Part("serve", tmp_path / "second.log", *options)
    assert second.wait() == 3
    assert "cannot listen at " in second.output
    assert daemon.endpoint in second.output
    assert "Traceback" not in second.output


@pytest.mark.parametrize("way", ["shutdown", "SIGTERM", "SIGINT"])
def test_a_daemon_leaves_cleanly(tmp_path, way):
    with daemon_at(tmp_path / "state") as daemon:
        with daemon.client() as client:
            if way == "shutdown":
                client.shutdown()
            else:
                daemon.signal(signal.Signals[way])
            assert daemon.wait() == 0
        assert not StatePaths(daemon.state).contact_file.exists()
        assert daemon.journal()[-1]["event"] == "stopped"
        assert daemon.output == ""


def test_strange_traffic_does_not_stop_the_daemon(daemon, client):
    with bus.open_client(daemon.endpoint) as session:
        session.put("scenario/v1/event", b"not json")
        session.put("scenario/v1/ask/run", b"not a question")
        token = session.liveliness().declare_token("scenario/v1/alive/ghost")
        token.undeclare()
    assert client.overview().workers == 0


def test_the_speed_of_a_run_under_way_tells_how_long_it_takes_at_most(tmp_path):
    # One of two slots is free: the worker asks for work each second, and says how far the run is.
    with daemon_at(tmp_path / "state", slots=2) as part, part.client() as client:
        # Far from its limit, however late it is asked for.
        client.submit(submission_of("c", replace(make_spec(sleep=600.0), limit=10_000.0)))

        def left():
            row = client.campaign("c")
            assert row is not None
            return row.seconds_left

        # It simulates a second in each; nothing else is known of it.
        first = eventually(left)
        eventually(lambda: 0.0 < left() < first)


def test_the_time_left_is_that_of_executed_runs_and_not_of_what_is_paused(tmp_path):
    gate = tmp_path / "gate"
    places = stored_scene(tmp_path / "state")
    with LedgerWriter.open(places) as ledger:
        ledger.submit(submission_of("before", make_spec(0)), 1.0)
        (grant,) = ledger.lease("w", 1, 1.0)
        # Long, so that the next one is still expected to run for a while whenever it is asked for.
        took = make_result(grant.spec, wall=1000.0)
        ledger.complete(Completion("w", grant.run, grant.attempt, grant.token, took), 2.0)
    with daemon_at(places.state, slots=1) as part, part.client() as client:
        assert client.overview().seconds_left is None
        client.submit(make_submission("c", 3, until=str(gate)))

        def left():
            row = client.campaign("c")
            assert row is not None
            return row.seconds_left if row.running else None

        assert 2000.0 < eventually(left) < 3001.0
        assert client.overview().seconds_left is not None
        client.steer("c", paused=True)
        paused = client.campaign("c")
        assert paused is not None
        assert paused.paused
        assert paused.seconds_left is None
        gate.touch()
        client.cancel("c")
        eventually(lambda: client.overview().seconds_left is None)


def stored_scene(state):
    """The places of a daemon that has the scene of runs and was never started."""
    places = StatePaths(state)
    places.make_folders()
    places.scene(SCENE.digest).write_bytes(codec.to_json(SCENE))
    return places


def test_runs_of_another_engine_wait_and_the_daemon_says_so_from_its_start(tmp_path):
    places = stored_scene(tmp_path / "state")
    with LedgerWriter.open(places) as ledger:
        old = replace(make_spec(0), engine="4")
        ledger.submit(submission_of("old", old, replace(old, repeat=1)), 1.0)
    words = f"runs of engine 4 wait, this version has engine {ENGINE_VERSION}"
    offline = [one.message for one in examine(places, Endpoint("tcp/127.0.0.1:1", "default"))]
    assert words in offline
    with daemon_at(places.state, slots=1) as daemon, daemon.client() as client:
        assert words in daemon.noted("held")[0]["why"]
        (trouble,) = client.overview().troubles
        assert trouble.words.startswith(words)
        client.submit(make_submission("new", 1))
        eventually(lambda: client.overview().done == 1)
        assert (client.campaign("old").queued, client.runs("old").rows[0].attempt) == (2, 0)
        client.cancel("old")
        assert client.overview().troubles == ()
        # Retried, they wait again: at the latest when one is asked for.
        client.retry("old")
        eventually(lambda: any(words in said.words for said in client.overview().troubles))
