"""Keys over TLS against a real daemon: who asks, who is believed, who is let in."""

import shutil
import tarfile
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from daemon.batch import bus
from daemon.batch.client import Client
from daemon.batch.errors import KeysUnusable, Refused, Unreachable
from daemon.batch.paths import StatePaths
from daemon.batch.security import find_credentials, find_daemon_credentials
from daemon.batch.security._access_control import CLIENT_ROLES, allowed_verbs
from daemon.batch.security.authority import create_authority, issue_key, pack_key, revoke_key
from daemon.model import verbs
from daemon.model.live_judgement import LiveJudgement, LogLine, pack_judgement
from daemon.model.messages import (
    ALIVE,
    ASK,
    EVENTS,
    JUDGED,
    LIVE,
    WORK,
    LeaseRequest,
    LedgerAnswer,
)
from daemon.model.spec import Snapshot
from daemon.model.status import LiveSnapshot
from daemon.model.verbs import VERBS, Role
from grammars.model.geometry import Pose2
from grammars.text import codec
from tests.chaos.light import LightWorker
from tests.make import make_submission
from tests.parts import daemon_at, eventually, free_endpoint, worker_for

NOW = datetime.now(UTC).replace(microsecond=0)
HERE = ("localhost", "127.0.0.1", "::1")


def tls():
    return free_endpoint().replace("tcp/", "tls/")


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """Keys of everybody; "anna" is revoked before the daemon starts."""
    folder = tmp_path_factory.mktemp("keys") / "all"
    create_authority(folder, HERE, NOW)
    issue_key(folder, Role.WORKER, "spare", (), NOW)
    for name in ("anna", "late", "calm"):
        issue_key(folder, Role.VIEWER, name, (), NOW)
    revoke_key(folder, "viewer.anna", NOW)
    return folder


@pytest.fixture(scope="module")
def daemon(keys, tmp_path_factory):
    state = tmp_path_factory.mktemp("secure") / "state"
    with daemon_at(state, listen=tls(), keys=str(keys)) as part:
        eventually(lambda: reached(part))
        yield part


def reached(part):
    return StatePaths(part.state).read_contact() is not None


def as_role(daemon, keys, name):
    return Client.open(daemon.endpoint, keys=keys / name, timeout=60.0)


def owner(daemon):
    return Client.open(StatePaths(daemon.state).endpoint, timeout=60.0)


def raw(daemon, keys, name):
    return bus.open_client(daemon.endpoint, find_credentials(Role.OPERATOR, keys / name))


def answered(session, name, verb):
    return bool(list(session.get(f"{ASK}/{name}/{verb}", payload=b"{", timeout=60.0)))


# --- roles


def test_each_role_may_do_its_own_and_is_told_why_not_the_rest(daemon, keys):
    with as_role(daemon, keys, "operator") as operator:
        assert operator.submit(make_submission("mine", 2)).runs == 2
        with pytest.raises(Refused, match='the key "operator" is that of an operator'):
            operator.ask(verbs.WELCOME, None)
    with as_role(daemon, keys, "viewer") as viewer:
        assert viewer.runs("mine").total == 2
        with pytest.raises(Refused, match="it may look, not steer or work"):
            viewer.cancel("mine")
    with (
        as_role(daemon, keys, "worker") as worker,
        pytest.raises(Refused, match="it may execute runs, not look or steer"),
    ):
        worker.overview()


@pytest.mark.parametrize("role", CLIENT_ROLES)
def test_the_bus_itself_drops_what_a_role_may_not_ask(daemon, keys, role):
    with raw(daemon, keys, role) as session:
        assert {verb for verb in VERBS if answered(session, role, verb)} == set(allowed_verbs(role))
        replies = []
        for key in (f"{ASK}/*/*", f"{ASK}/**", "**", f"{ASK}/*/{allowed_verbs(role)[0]}"):
            session.get(key, replies.append, payload=b"{", timeout=60.0)
            # What is asked later is answered: nothing else will be.
            assert answered(session, role, allowed_verbs(role)[0])
        assert replies == []
        # What Zenoh tells of itself: only the session's own.
        tellers = {str(reply.ok.key_expr).split("/")[1] for reply in session.get("@/**")}
        assert tellers <= {str(session.zid())}


def test_nobody_can_answer_publish_or_listen_in_the_daemons_place(daemon, keys):
    heard, stolen, events, lives = [], [], [], []

    def note(sample):
        heard.append(str(sample.key_expr))

    with (
        owner(daemon) as mine,
        as_role(daemon, keys, "viewer") as watcher,
        raw(daemon, keys, "worker") as worker,
        raw(daemon, keys, "viewer") as viewer,
        raw(daemon, keys, "worker") as curious,
        raw(daemon, keys, "viewer") as nosy,
    ):
        watcher.events(events.append, lives.append)
        curious.declare_subscriber("**", note)
        nosy.declare_subscriber("**", note)
        worker.declare_queryable(f"{ASK}/**", lambda query: stolen.append(str(query.key_expr)))
        for session in (worker, viewer):
            for key in (EVENTS, WORK, f"{ASK}/operator/submit", "scenario/v1/other"):
                session.put(key, b"forged")
        viewer.put(f"{LIVE}/viewer/ghost", b"forged")
        viewer.liveliness().declare_token(f"{ALIVE}/viewer/ghost")
        # Answered behind it on the same link: the daemon knows who listens.
        watcher.overview()
        mine.submit(make_submission("watched"))
        eventually(lambda: events)
        assert [event.kind for event in events] == ["campaign"]
        assert heard == stolen == lives == []


def test_a_viewer_watches_a_run_and_its_worker_knows(daemon, keys):
    seen, judged = [], []
    picture = LiveSnapshot(
        "first.1", Snapshot(1.0, 9.0, Pose2(), None, 0, 1, (), waiting="\x1b", returns=(100, 200))
    )
    said = LiveJudgement("first.1", 1.0, (), (), (), (), (LogLine(1.0, "sut", "\x1b[2Jgone"),))
    with as_role(daemon, keys, "viewer") as watcher, raw(daemon, keys, "worker") as worker:
        key = f"{LIVE}/worker/worker-1/first.1"
        mine, judging = worker.declare_publisher(key), worker.declare_publisher(f"{key}/{JUDGED}")
        other = worker.declare_publisher(f"{LIVE}/worker/worker-1/first.2")
        with watcher.watch("first.1", seen.append):
            eventually(lambda: mine.matching_status.matching)
            assert not other.matching_status.matching
            assert not judging.matching_status.matching
            for forged in (b"", b"{}", codec.to_json(replace(picture, run="first.2"))):
                mine.put(forged)
            mine.put(codec.to_json(picture))
            eventually(lambda: seen)
        shown = replace(picture.snapshot, waiting="\N{REPLACEMENT CHARACTER}")
        assert seen == [replace(picture, snapshot=shown)]
        eventually(lambda: not mine.matching_status.matching)
        with watcher.watch("first.1", lambda _: None, judged.append):
            eventually(lambda: judging.matching_status.matching)
            other_run = pack_judgement(replace(said, run="first.2"))
            for forged in (b"", b"forged", codec.to_json(said), other_run):
                judging.put(forged)
            judging.put(pack_judgement(said))
            eventually(lambda: judged)
        assert [one.log[0].text for one in judged] == ["\N{REPLACEMENT CHARACTER}[2Jgone"]


def test_a_key_asks_under_its_own_name_only(daemon, keys):
    with owner(daemon) as mine, raw(daemon, keys, "worker.spare") as session:
        key, places = find_credentials(Role.WORKER, keys / "worker.spare"), StatePaths(daemon.state)
        spare = LightWorker(session, daemon.endpoint, "of-spare", 1, places, key, timeout=60.0)
        mine.submit(make_submission("named", 2))
        replies = []
        body = codec.to_json(LeaseRequest(spare.me(), 1))
        for name in ("worker", "owner", "operator", "*", "**", "worker.spar$*"):
            session.get(f"{ASK}/{name}/lease", replies.append, payload=body, timeout=60.0)
        (grant,) = spare.lease()
        assert replies == []
        assert spare.complete(grant) is LedgerAnswer.RECORDED
        mine.cancel("named")


# --- keys that are not taken


def test_a_revoked_key_gets_no_answer_and_is_told_what_that_may_mean(daemon, keys):
    with (
        as_role(daemon, keys, "viewer.anna") as anna,
        pytest.raises(Unreachable, match=r'does not answer to the key "viewer\.anna".*revoked'),
    ):
        anna.overview()


def test_a_key_that_is_revoked_is_refused_by_a_daemon_that_runs(daemon, keys):
    def refusal(client):
        try:
            client.overview()
        except Refused as error:
            return str(error)
        return ""

    with as_role(daemon, keys, "viewer.late") as late:
        late.overview()
        revoke_key(keys, "viewer.late", NOW)
        assert 'the key "viewer.late" was revoked' in eventually(lambda: refusal(late))
    with as_role(daemon, keys, "viewer") as another:
        another.overview()
    assert [line["key"] for line in daemon.noted("key revoked")] == ["viewer.anna", "viewer.late"]


def test_who_has_no_key_of_this_authority_does_not_come_in(daemon, keys, tmp_path):
    create_authority(tmp_path / "other", HERE, NOW)
    foreign = tmp_path / "foreign"
    shutil.copytree(tmp_path / "other" / "operator", foreign)
    with pytest.raises(Unreachable, match="does not prove to be the daemon of these keys"):
        Client.open(daemon.endpoint, keys=foreign)
    shutil.copy(keys / "ca.pem", foreign / "ca.pem")
    with pytest.raises(Unreachable, match='does not accept the key "operator"'):
        Client.open(daemon.endpoint, keys=foreign)
    with pytest.raises(KeysUnusable, match=r"scenario keys bundle"):
        Client.open(daemon.endpoint, keys=tmp_path / "nothing")
    with pytest.raises(Unreachable):
        Client.open(daemon.endpoint.replace("tls/", "tcp/"))


def test_a_daemon_must_have_the_name_it_is_called_by(daemon, keys):
    elsewhere = daemon.endpoint.replace("127.0.0.1", "127.0.0.2")
    with pytest.raises(Unreachable):
        bus.open_client(elsewhere, find_credentials(Role.OPERATOR, keys))


def test_the_key_of_a_worker_does_not_pose_as_a_daemon(keys):
    genuine = find_daemon_credentials(keys)
    posing = replace(genuine, credentials=find_credentials(Role.WORKER, keys))
    endpoint = tls()
    with bus.open_router([endpoint], posing), pytest.raises(Unreachable, match="prove to be"):
        bus.open_client(endpoint, find_credentials(Role.OPERATOR, keys))


# --- the port


def unpacked(keys, name, folder):
    """Where the key is after its bundle was unpacked."""
    pack_key(keys, name, folder / f"{name}.tar")
    with tarfile.open(folder / f"{name}.tar") as opened:
        opened.extractall(folder / name, filter="data")
    return folder / name / "keys"


def test_a_remote_worker_executes_runs_over_tls(daemon, keys, tmp_path):
    there = unpacked(keys, "worker", tmp_path)
    with worker_for(daemon, 2, "--keys", str(there)), owner(daemon) as mine:
        mine.submit(make_submission("remote", 4))
        eventually(lambda: mine.campaign("remote").done == 4)


def test_no_file_of_the_daemon_has_a_secret(daemon, keys):
    secrets = [path.read_text().splitlines()[1] for path in keys.rglob("key.pem")]
    files = [path for path in daemon.state.rglob("*") if path.is_file()]
    assert {"daemon.log", "ledger.db"} <= {path.name for path in files}
    written = b"".join(path.read_bytes() for path in files) + daemon.output.encode()
    assert [secret for secret in secrets if secret.encode() in written] == []


def test_of_a_daemon_that_was_killed_nothing_is_said_about_the_key(keys, tmp_path):
    with daemon_at(tmp_path / "state", listen=tls(), keys=str(keys)) as part:
        eventually(lambda: reached(part))
        with as_role(part, keys, "viewer.calm") as calm:
            calm.overview()
            part.kill()
            with pytest.raises(Unreachable) as problem:
                calm.overview()
    assert str(problem.value).startswith(f"no daemon answers at {part.endpoint}: start one")
