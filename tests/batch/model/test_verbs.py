"""Verbs: what follows from their declarations."""

import pytest

from daemon.model import verbs
from daemon.model.messages import Empty, IdRequest, RunQuery
from daemon.model.verbs import VERBS, DaemonClient, Role, ServerThread
from tests.people.fake import FakeDaemon

METHODS = {
    "search": "begin_search",
    "extend": "ask",
    "progress": "ask",
}
"""Verbs that a client's method of another name asks. The last two are asked by nobody but
clients that run searches.
"""


class Asked(FakeDaemon):
    """Says what it was asked."""

    def ask(self, verb, request):
        return verb, request


def test_verbs_are_known_by_their_names():
    assert list(VERBS)[:4] == ["overview", "campaigns", "runs", "run"]
    assert all(verb.name == name == str(verb) for name, verb in VERBS.items())
    assert len(VERBS) == 26


@pytest.mark.parametrize("verb", [v for v in VERBS.values() if Role.OPERATOR in v.roles], ids=str)
def test_what_operators_may_ask_clients_can(verb):
    assert callable(getattr(DaemonClient, METHODS.get(verb.name, verb.name)))


def test_a_clients_method_takes_the_fields_of_the_request():
    client = Asked()
    assert client.overview() == (verbs.OVERVIEW, Empty())
    assert client.run("c.1") == (verbs.RUN, IdRequest("c.1"))
    assert client.runs("c", state="done", limit=7) == (
        verbs.RUNS,
        RunQuery("c", state="done", limit=7),
    )
    with pytest.raises(TypeError):
        client.runs("c", colour="red")
    assert DaemonClient.disk.__doc__ == verbs.DISK.about


def test_only_the_writers_verbs_change_the_ledger():
    """Nobody who may only look is done by the writer, whom everybody else waits for."""
    for verb in VERBS.values():
        if Role.VIEWER in verb.roles:
            assert verb.thread is not ServerThread.WRITER, verb


def test_words_of_a_retry_are_told_apart_before_they_are_sent():
    fake = FakeDaemon()
    assert fake.retry("c", only=" lost | fail|") == 1
    assert fake.calls == [("retry", "c", ("lost", "fail"))]
