"""Names of keys, over TLS against a real daemon: who asks, who is believed, who is let in."""

import socket
import ssl
from contextlib import closing, contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version

import pytest

from daemon.batch import bus
from daemon.batch.client import Client
from daemon.batch.errors import DaemonError, Refused, Unreachable
from daemon.batch.paths import StatePaths
from daemon.batch.security import find_credentials, find_daemon_credentials
from daemon.batch.security.authority import create_authority, issue_key, revoke_key
from daemon.model import verbs
from daemon.model.messages import (
    ASK,
    Completion,
    LeaseRequest,
    LedgerAnswer,
    WorkerInfo,
)
from daemon.model.verbs import Role
from grammars.text import codec
from tests.make import make_result, make_submission
from tests.parts import daemon_at, eventually, free_endpoint

NOW = datetime.now(UTC).replace(microsecond=0)
HERE = ("localhost", "127.0.0.1", "::1")


def tls():
    return free_endpoint().replace("tcp/", "tls/")


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    folder = tmp_path_factory.mktemp("keys") / "all"
    create_authority(folder, HERE, NOW)
    for name in ("spare", "bad", "good"):
        issue_key(folder, Role.WORKER, name, (), NOW)
    for name in ("late", "calm"):
        issue_key(folder, Role.VIEWER, name, (), NOW)
    issue_key(folder, Role.OPERATOR, "loud", (), NOW)
    return folder


@pytest.fixture(scope="module")
def daemon(keys, tmp_path_factory):
    state = tmp_path_factory.mktemp("trust") / "state"
    with daemon_at(state, listen=tls(), keys=str(keys), lease=900.0) as part:
        eventually(lambda: reached(part))
        yield part


def reached(part):
    return StatePaths(part.state).read_contact() is not None


class Holder:
    """A worker of a key by what it says on the bus."""

    def __init__(self, daemon, session, key):
        self.daemon, self.session, self.key = daemon, session, key
        self.me = WorkerInfo(
            f"of-{key.name.replace('.', '-')}", "h", 1, version("scenario-tui"), 4, 0
        )
        self.me = replace(self.me, era=self.ask(verbs.WELCOME, self.me).era)

    def ask(self, verb, request):
        return bus.ask(self.session, self.daemon.endpoint, verb, request, 60.0, self.key)

    def lease(self, count=100):
        return self.ask(verbs.LEASE, LeaseRequest(self.me, count)).grants

    def complete(self, grant, margin=0.5):
        result = make_result(grant.spec, margin=margin)
        places, sha256 = StatePaths(self.daemon.state), result.trace.sha256
        places.uploaded_trace(grant.run, grant.token, sha256).touch()
        ours = (self.me.id, grant.run, grant.attempt, grant.token)
        done = Completion(*ours, result, era=grant.era)
        return self.ask(verbs.COMPLETE, done).answer


@contextmanager
def holder(daemon, keys, name):
    key = find_credentials(Role.WORKER, keys / name)
    with bus.open_client(daemon.endpoint, key) as session:
        yield Holder(daemon, session, key)


def as_key(daemon, keys, name):
    return Client.open(daemon.endpoint, keys=keys / name, timeout=60.0)


def owner(daemon):
    return Client.open(StatePaths(daemon.state).endpoint, timeout=60.0)


# --- names


def test_a_key_asks_under_its_own_name_only(daemon, keys):
    with owner(daemon) as mine, holder(daemon, keys, "worker.spare") as spare:
        mine.submit(make_submission("named", 2))
        replies = []
        body = codec.to_json(LeaseRequest(spare.me, 1))
        for name in ("worker", "owner", "operator", "*", "**", "worker.spar$*"):
            spare.session.get(f"{ASK}/{name}/lease", replies.append, payload=body, timeout=60.0)
        (grant,) = spare.lease(1)
        assert replies == []
        assert spare.complete(grant) is LedgerAnswer.RECORDED
        mine.cancel("named")


def test_a_revoked_key_is_refused_by_a_daemon_that_runs(daemon, keys):
    with as_key(daemon, keys, "viewer.late") as late:
        late.overview()
        revoke_key(keys, "viewer.late", NOW)
        assert 'the key "viewer.late" was revoked' in eventually(lambda: refusal(late))
    with as_key(daemon, keys, "viewer") as another:
        another.overview()
    assert [line["key"] for line in daemon.noted("key revoked")] == ["viewer.late"]


def refusal(client):
    try:
        client.overview()
    except Refused as error:
        return str(error)
    return ""


# --- the port


def test_who_comes_over_tls_is_not_the_owner(daemon, keys):
    with bus.open_client(
        daemon.endpoint, find_credentials(Role.WORKER, keys / "worker")
    ) as session:
        for name in ("worker", "owner"):
            for verb in (verbs.SHUTDOWN, verbs.OVERVIEW):
                assert list(session.get(f"{ASK}/{name}/{verb}", payload=b"{}", timeout=60.0)) == []


def test_it_listens_at_addresses_of_either_kind(keys):
    with closing(socket.socket(socket.AF_INET6)) as probe:
        try:
            probe.bind(("::1", 0))
        except OSError:
            pytest.skip("there is no IPv6 here")
    address = free_endpoint("::").replace("tcp/", "tls/")
    port = int(address.rpartition(":")[2])
    with bus.open_router([address], find_daemon_credentials(keys)):
        context = ssl.create_default_context(cafile=str(keys / "ca.pem"))
        context.load_cert_chain(keys / "viewer" / "cert.pem", keys / "viewer" / "key.pem")
        for host in ("::1", "127.0.0.1"):
            with (
                socket.create_connection((host, port), timeout=60.0) as plain,
                context.wrap_socket(plain, server_hostname=host) as wrapped,
            ):
                assert wrapped.version() == "TLSv1.3"


def test_an_address_that_is_taken_is_said(keys):
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(DaemonError, match=f"cannot listen at tls/127.0.0.1:{port}"):
            bus.open_router([f"tls/127.0.0.1:{port}"], find_daemon_credentials(keys))


def test_of_a_daemon_that_was_killed_nothing_is_said_about_the_key(keys, tmp_path):
    with daemon_at(tmp_path / "state", listen=tls(), keys=str(keys)) as part:
        eventually(lambda: reached(part))
        with as_key(part, keys, "viewer.calm") as calm:
            calm.overview()
            part.kill()
            with pytest.raises(Unreachable) as problem:
                calm.overview()
    assert str(problem.value).startswith(f"no daemon answers at {part.endpoint}: start one")
