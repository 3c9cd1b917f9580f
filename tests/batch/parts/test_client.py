"""A client and its daemon: events, silence, restarts, other versions."""

import gc
import signal
import threading
import weakref

import psutil
import pytest
import zenoh

from daemon.batch import bus
from daemon.batch.client import Client
from daemon.batch.errors import DaemonError, Refused, Unreachable
from daemon.model.messages import ASK, EVENTS
from daemon.model.status import ChangeEvent
from grammars.text import codec
from tests.make import make_submission
from tests.parts import eventually, free_endpoint


@pytest.fixture
def client(daemon):
    with daemon.client() as connected:
        yield connected


def test_nobody_there_is_unreachable_and_says_what_to_do():
    endpoint = free_endpoint()
    with pytest.raises(Unreachable, match=f"{endpoint}: start one with `scenario daemon`"):
        Client.open(endpoint)
    with pytest.raises(DaemonError, match=r"write tcp/<host>:<port>"):
        Client.open("localhost:7447")


def test_events_come_in_order_and_without_gaps(client):
    events = []
    with client.events(events.append):
        for number in range(20):
            client.submit(make_submission(f"c{number}"))
        client.cancel("c7")
        eventually(lambda: len(events) == 22)
    assert [event.seq for event in events] == list(range(1, 23))
    assert events[0] == ChangeEvent(1, "campaign", "c0", "c0", "submitted")
    assert [event.state for event in events[-2:]] == ["cancelled", "finished"]
    client.submit(make_submission("after"))
    client.overview()
    assert len(events) == 22


def test_a_slow_listener_loses_the_oldest_and_stops_nobody(daemon, client):
    events, quick, gate = [], [], threading.Event()

    def slow(event):
        gate.wait()
        events.append(event)

    with (
        client.events(slow),
        client.events(lambda event: quick.append(event.seq)),
        bus.open_client(daemon.endpoint) as session,
    ):
        for seq in range(6000):
            session.put(EVENTS, codec.to_json(ChangeEvent(seq, "run", "r")))
        session.put(EVENTS, b"nonsense")
        assert client.overview().campaigns == 0

        def last_arrived():
            # Said until it is heard: the bus drops events where nobody keeps up with them.
            session.put(EVENTS, codec.to_json(ChangeEvent(9999, "run", "last")))
            return bool(quick) and quick[-1] == 9999

        try:
            eventually(last_arrived)  # by then all that will have arrived
        finally:
            gate.set()  # or the subscription would wait for its listener for ever
        eventually(lambda: events and events[-1].seq == 9999)
    assert len(events) < 4200
    assert [event.seq for event in events] == sorted(event.seq for event in events)


def test_a_frozen_daemon_is_unreachable_after_the_timeout(daemon):
    with (
        daemon.client(timeout=3600.0) as client,
        Client.open(daemon.endpoint, timeout=0.01) as hasty,
    ):
        daemon.freeze()
        with pytest.raises(Unreachable):
            hasty.overview()  # with the timeout of the other one this test would not end
        daemon.signal(signal.SIGCONT)
        assert eventually(lambda: client.overview().now)


def test_a_client_survives_the_restart_of_its_daemon(daemon, client):
    events = []

    def campaigns():
        try:
            return client.overview().campaigns
        except Unreachable:
            return None

    client.events(events.append)
    client.submit(make_submission("before"))
    daemon.kill()
    eventually(lambda: campaigns() is None)
    daemon.restart()
    eventually(lambda: campaigns() == 1)
    client.submit(make_submission("after"))
    eventually(lambda: any(event.id == "after" for event in events))
    assert [event.seq for event in events] == sorted({event.seq for event in events})


@pytest.mark.usefixtures("client")
def test_a_client_listens_nowhere():
    sockets = psutil.Process().net_connections("inet")
    assert {s.status for s in sockets} <= {psutil.CONN_ESTABLISHED, psutil.CONN_TIME_WAIT}
    assert all(s.raddr.ip == "127.0.0.1" for s in sockets)


def test_closing_twice_and_with_open_subscriptions_is_fine(client):
    client.events(lambda _: None, lambda _: None).close()
    closed = client.watch("c.0", lambda _: None)
    closed.close()
    kept = weakref.ref(closed)
    del closed
    gc.collect()
    assert kept() is None
    client.events(lambda _: None)
    client.close()
    client.close()


def test_a_daemon_that_hangs_does_not_make_closing_fail():
    class Hanging:
        def close(self):
            raise zenoh.ZError("close operation timed out!")

    Client(Hanging(), "tcp/127.0.0.1:7447", 3.0, None).close()


@pytest.mark.parametrize("theirs", [b"scenario-tui 99, engine 99, protocol 99", b"scenario-tui 0"])
def test_what_another_version_asks_and_is_refused_says_which_versions_there_are(
    daemon, client, monkeypatch, theirs
):
    own = bus.speaker().decode()
    with pytest.raises(Refused, match=r"^there is no run c\.0$"):
        client.run("c.0")
    monkeypatch.setattr(bus, "speaker", lambda: theirs)
    words = f"versions differ: the requester has {theirs.decode()}, this is {own}"
    with pytest.raises(Refused, match=words):
        client.run("c.0")
    assert words in daemon.noted("refused")[-1]["problem"]


@pytest.mark.parametrize(
    ("attached", "said"),
    [
        (b"scenario-tui 99, engine 99, protocol 99", "the daemon has scenario-tui 99, engine 99"),
        (None, "the daemon has an older version"),
    ],
)
def test_an_answer_of_another_version_that_is_not_understood_says_which_it_is(attached, said):
    endpoint = free_endpoint()

    def answer(query):
        with query:
            query.reply(query.key_expr, b'{"grown": 1}', attachment=attached)

    with bus.open_router((endpoint,)) as router, Client.open(endpoint) as client:
        router.declare_queryable(f"{ASK}/*/*", answer)
        with pytest.raises(Refused, match=f"is not understood; versions differ: {said}"):
            client.overview()
