import json
import math
import os
import shutil
import stat
import subprocess
import tarfile
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

import pytest

from daemon.batch import bus
from daemon.batch.client import Client
from daemon.batch.errors import DaemonError, KeysUnusable, Refused, Unreachable
from daemon.batch.operation import FindingLevel, check_keys
from daemon.batch.paths import StatePaths, find_endpoint, is_endpoint, is_local
from daemon.batch.security import (
    access_control,
    denial_text,
    find_credentials,
    find_daemon_credentials,
    load_register,
    strip_control_characters,
)
from daemon.batch.security._access_control import CLIENT_ROLES, allowed_verbs
from daemon.batch.security.authority import create_authority, issue_key, pack_key, revoke_key
from daemon.batch.server import exposure_warning
from daemon.batch.server._opening import prepare_endpoints
from daemon.model import verbs
from daemon.model.live_judgement import LiveJudgement, LogLine, pack_judgement
from daemon.model.messages import ALIVE, ASK, EVENTS, JUDGED, LIVE, WORK
from daemon.model.spec import Snapshot
from daemon.model.status import LiveSnapshot
from daemon.model.verbs import VERBS, Role
from grammars.model.geometry import Pose2
from grammars.model.robot import Drive
from grammars.text import codec
from tests.make import ROBOT, make_submission
from tests.parts import (
    Part,
    daemon_at,
    eventually,
    free_endpoint,
    worker_for,
)

NOW = datetime.now(UTC).replace(microsecond=0)
HERE = ("localhost", "127.0.0.1")


def tls():
    return free_endpoint().replace("tcp/", "tls/")


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """Keys of everybody; "anna" is revoked before the daemon starts."""
    folder = tmp_path_factory.mktemp("keys") / "all"
    create_authority(folder, HERE, NOW)
    issue_key(folder, Role.VIEWER, "anna", (), NOW)
    revoke_key(folder, "viewer.anna", NOW)
    return folder


@pytest.fixture(scope="module")
def daemon(keys, tmp_path_factory):
    state = tmp_path_factory.mktemp("secure") / "state"
    with daemon_at(state, listen=tls(), keys=str(keys)) as part:
        with Client.open(eventually(lambda: reached(part)), keys=keys / "operator") as client:
            client.overview()
        yield part


def reached(part):
    contact = StatePaths(part.state).read_contact()
    return "" if contact is None else part.endpoint


def as_role(daemon, keys, name):
    return Client.open(daemon.endpoint, keys=keys / name, timeout=30.0)


def raw(daemon, keys, name):
    return bus.open_client(daemon.endpoint, find_credentials(Role.OPERATOR, keys / name))


# --- roles, against a real daemon


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


def answered(session, name, verb):
    return bool(list(session.get(f"{ASK}/{name}/{verb}", payload=b"{", timeout=60.0)))


@pytest.mark.parametrize("role", CLIENT_ROLES)
def test_the_bus_itself_drops_what_a_role_may_not_ask(daemon, keys, role):
    with raw(daemon, keys, role) as session:
        verbs = {verb for verb in VERBS if answered(session, role, verb)}
        assert verbs == set(allowed_verbs(role))
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
    heard = []
    stolen = []

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
        events = []
        lives = []
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
    told = []
    picture = LiveSnapshot(
        "first.1", Snapshot(1.0, 9.0, Pose2(), None, 0, 1, (), returns=(100, 200))
    )
    with as_role(daemon, keys, "viewer") as watcher, raw(daemon, keys, "worker") as worker:
        mine = worker.declare_publisher(f"{LIVE}/worker/worker-1/first.1")
        other = worker.declare_publisher(f"{LIVE}/worker/worker-1/first.2")
        with watcher.watch("first.1", told.append):
            eventually(lambda: mine.matching_status.matching)
            assert not other.matching_status.matching
            mine.put(codec.to_json(picture))
            eventually(lambda: told)
        assert told == [picture]
        eventually(lambda: not mine.matching_status.matching)


def test_a_viewer_is_told_what_a_run_is_judged_by_without_control_characters(daemon, keys):
    told = []
    line = LogLine(1.0, "sut", "\x1b[2Jgone")
    said = LiveJudgement("first.1", 1.0, (), (), (), (), (line,))
    with as_role(daemon, keys, "viewer") as watcher, raw(daemon, keys, "worker") as worker:
        key = f"{LIVE}/worker/worker-1/first.1"
        pictures, mine = worker.declare_publisher(key), worker.declare_publisher(f"{key}/{JUDGED}")
        with watcher.watch("first.1", lambda _: None):
            eventually(lambda: pictures.matching_status.matching)
            assert not mine.matching_status.matching
        with watcher.watch("first.1", lambda _: None, told.append):
            eventually(lambda: mine.matching_status.matching)
            for forged in (b"", b"forged", codec.to_json(said)):
                mine.put(forged)
            mine.put(pack_judgement(said))
            eventually(lambda: told)
        assert [one.log[0].text for one in told] == ["\N{REPLACEMENT CHARACTER}[2Jgone"]


def owner(daemon):
    return Client.open(StatePaths(daemon.state).endpoint, timeout=30.0)


def test_a_revoked_key_gets_no_answer_and_is_told_what_that_may_mean(daemon, keys):
    with (
        as_role(daemon, keys, "viewer.anna") as anna,
        pytest.raises(Unreachable, match=r'does not answer to the key "viewer\.anna".*revoked'),
    ):
        anna.overview()


def test_who_has_no_key_of_this_authority_does_not_come_in(daemon, keys, tmp_path):
    create_authority(tmp_path / "other", HERE, NOW)
    foreign = tmp_path / "foreign"
    shutil.copytree(tmp_path / "other" / "operator", foreign)
    with pytest.raises(Unreachable, match="does not prove to be the daemon of these keys"):
        Client.open(daemon.endpoint, keys=foreign)
    shutil.copy(keys / "ca.pem", foreign / "ca.pem")
    with pytest.raises(Unreachable, match='does not take the key "operator"'):
        Client.open(daemon.endpoint, keys=foreign)
    with pytest.raises(KeysUnusable, match=r"scenario keys bundle"):
        Client.open(daemon.endpoint, keys=tmp_path / "nothing")
    plain = daemon.endpoint.replace("tls/", "tcp/")
    with pytest.raises(Unreachable):
        Client.open(plain)


def test_a_daemon_must_have_the_name_it_is_called_by(daemon, keys):
    elsewhere = daemon.endpoint.replace("127.0.0.1", "127.0.0.2")
    holder = find_credentials(Role.OPERATOR, keys)
    with pytest.raises(Unreachable):
        bus.open_client(elsewhere, holder)


def test_the_key_of_a_worker_makes_no_daemon(keys, tmp_path):
    with pytest.raises(KeysUnusable, match="not one of a daemon"):
        find_daemon_credentials(with_register(keys, "worker", tmp_path / "worker"))
    fake = find_daemon_credentials(keys)
    settings = find_credentials(Role.WORKER, keys)
    posing = type(fake)(settings, fake.register, fake.folder)
    endpoint = tls()
    with bus.open_router([endpoint], posing), pytest.raises(Unreachable, match="prove to be"):
        bus.open_client(endpoint, find_credentials(Role.OPERATOR, keys))


def with_register(keys, name, folder):
    shutil.copytree(keys / name, folder)
    shutil.copy(keys / "register.json", folder / "register.json")
    return folder


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
        eventually(lambda: mine.campaigns()[0].done == 4)


def test_the_owner_needs_no_key_on_the_daemons_machine(daemon):
    with owner(daemon) as mine:
        assert mine.overview().state == str(daemon.state)
    found = StatePaths(daemon.state).socket
    assert stat.S_IMODE(found.parent.stat().st_mode) == 0o700


# --- who may listen and connect where


def test_plain_tcp_for_other_machines_must_be_asked_for(tmp_path):
    options = ("--state", str(tmp_path / "state"), "--listen", "tcp/0.0.0.0:7447", "--slots", "0")
    part = Part("serve", tmp_path / "log", *options)
    assert part.wait() == 3
    assert "say --insecure" in part.output
    assert "Traceback" not in part.output


def test_insecure_is_said_aloud():
    assert exposure_warning("tcp/0.0.0.0:1").startswith("INSECURE: everybody in the network")
    assert "an account on this machine" in exposure_warning("tcp/127.0.0.1:1")
    assert exposure_warning("tls/0.0.0.0:1") == exposure_warning("") == ""


def test_nobody_speaks_plain_tcp_to_another_machine_by_mistake(monkeypatch):
    with pytest.raises(DaemonError, match="use tls/ with keys"):
        Client.open("tcp/192.0.2.1:7447")
    for endpoint in ("tcp/127.0.0.9:1", "tcp/[::1]:1", "tcp/localhost:1", "unixsock-stream//a"):
        assert is_local(endpoint)
    for endpoint in (
        "tcp/192.0.2.7:7447",
        "tcp/127.0.0.1.example.org:1",
        "tcp/[::]:1",
        "tcp/0.0.0.0:1",
        "tls/h:1",
    ):
        assert not is_local(endpoint)


def test_an_endpoint_carries_no_settings_for_the_bus():
    assert is_endpoint("tls/server:7447")
    assert is_endpoint("unixsock-stream//run/scenario/daemon.sock")
    for text in (
        "tcp/h:1#iface=eth0",
        "tls/h:1?rel=0",
        "unixsock-stream//a#b",
        "unixsock-stream//a\x00",
        "unixsock-stream/relative",
        "tls/h:1\n",
    ):
        assert not is_endpoint(text)


def test_without_a_word_only_the_own_daemon_is_asked(tmp_path):
    environ = {"SCENARIO_STATE": str(tmp_path)}
    assert find_endpoint("", None, environ).address == StatePaths(tmp_path).endpoint


def test_a_socket_with_a_long_path_lies_with_the_temporary_files(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    places = StatePaths(tmp_path / ("long" * 40))
    assert len(os.fsencode(places.socket)) < len(os.fsencode(tmp_path)) + 45
    assert places.socket != StatePaths(tmp_path / ("long" * 41)).socket
    places.make_socket_folder()
    places.socket.parent.chmod(0o755)
    places.make_socket_folder()
    assert stat.S_IMODE(places.socket.parent.stat().st_mode) == 0o700
    places.socket.parent.rmdir()
    places.socket.parent.symlink_to(tmp_path)
    with pytest.raises(PermissionError, match="belongs to somebody else"):
        places.make_socket_folder()


# --- the rules


def test_every_verb_has_its_roles_and_its_size():
    for name, verb in VERBS.items():
        assert verb.roles <= set(CLIENT_ROLES), name
        assert verb.roles, name
        assert 0 < verb.largest <= verbs.SUBMIT.largest


def test_viewers_change_nothing_and_only_workers_touch_leases():
    steering = {
        "submit",
        "cancel",
        "retry",
        "acknowledge",
        "steer",
        "shutdown",
    }
    working = {"welcome", "lease", "renew", "complete", "release"}
    assert not set(allowed_verbs(Role.VIEWER)) & (steering | working | {"put"})
    assert set(allowed_verbs(Role.VIEWER)) < set(allowed_verbs(Role.OPERATOR))
    assert set(allowed_verbs(Role.OPERATOR)) & (steering | working) == steering
    assert set(allowed_verbs(Role.WORKER)) == working | {"get", "put"}
    assert allowed_verbs(Role.DAEMON) == ()


def test_a_denial_names_the_key_and_who_is_needed():
    words = denial_text("viewer.anna", Role.VIEWER, verbs.SUBMIT)
    assert words.startswith('submit: the key "viewer.anna" is that of a viewer')
    assert "for the key of an operator" in words
    assert denial_text("viewer", Role.VIEWER, verbs.RUNS) == ""


def test_access_control_knows_valid_keys_only(keys):
    made = json.loads(json.dumps(access_control(load_register(keys))))
    names = [name for one in made["subjects"] for name in one.get("cert_common_names", ())]
    assert sorted(names) == ["operator", "viewer", "worker"]
    assert made["default_permission"] == "deny"


# --- keys


def test_keys_are_private_and_never_overwritten(keys, tmp_path):
    for path in keys.rglob("*"):
        assert not path.stat().st_mode & 0o077 or path.name == "register.json", path
    before = {path: path.read_bytes() for path in keys.rglob("*.pem")}
    with pytest.raises(KeysUnusable, match="has keys already"):
        create_authority(keys, HERE, NOW)
    with pytest.raises(KeysUnusable, match='"worker" exists'):
        issue_key(keys, Role.WORKER, "", (), NOW)
    with pytest.raises(KeysUnusable, match="was revoked: choose another name"):
        issue_key(keys, Role.VIEWER, "anna", (), NOW)
    assert {path: path.read_bytes() for path in keys.rglob("*.pem")} == before


@pytest.mark.parametrize("name", ["../x", "A", "a.b", "x" * 41, "a b", "-a", "a\n"])
def test_the_name_of_a_key_must_be_one(keys, name):
    with pytest.raises(KeysUnusable, match="is no name of a key"):
        issue_key(keys, Role.VIEWER, name, (), NOW)


@pytest.mark.parametrize("host", ["", "a b", "*", "-x", "a/b", "x" * 300])
def test_the_host_of_a_daemon_must_be_one(tmp_path, host):
    with pytest.raises(KeysUnusable, match="neither the name of a host nor an address"):
        create_authority(tmp_path / "keys", (host,), NOW)
    assert not (tmp_path / "keys").exists()


def test_a_key_that_others_can_read_is_not_used(keys, tmp_path):
    shutil.copytree(keys / "viewer", tmp_path / "viewer")
    (tmp_path / "viewer" / "key.pem").chmod(0o640)
    with pytest.raises(KeysUnusable, match="others can read"):
        find_credentials(Role.VIEWER, tmp_path / "viewer")


def test_damaged_keys_are_said(keys, tmp_path):
    shutil.copytree(keys, tmp_path / "keys")
    (tmp_path / "keys" / "viewer" / "cert.pem").write_text("nonsense")
    with pytest.raises(KeysUnusable, match="is none of ours"):
        find_credentials(Role.VIEWER, tmp_path / "keys")
    (tmp_path / "keys" / "register.json").write_text("{")
    with pytest.raises(KeysUnusable, match=r"register.json is damaged"):
        find_daemon_credentials(tmp_path / "keys")
    (tmp_path / "keys" / "ca.key").unlink()
    with pytest.raises(KeysUnusable, match="has no authority"):
        issue_key(tmp_path / "keys", Role.VIEWER, "late", (), NOW)


def test_a_bundle_unpacks_into_a_key_and_is_never_overwritten(keys, tmp_path):
    archive = tmp_path / "worker.tar"
    assert find_credentials(Role.WORKER, unpacked(keys, "worker", tmp_path)).name == "worker"
    assert stat.S_IMODE(archive.stat().st_mode) == 0o600
    for refused in ("worker.unknown", "viewer.anna", "../worker"):
        with pytest.raises(KeysUnusable, match="there is no key"):
            pack_key(keys, refused, tmp_path / "other.tar")
    with pytest.raises(KeysUnusable, match="is there already"):
        pack_key(keys, "worker", archive)
    there = unpacked(keys, "daemon", tmp_path)
    assert find_daemon_credentials(there).credentials.role is Role.DAEMON


def test_openssl_agrees_with_the_certificates(keys):
    if shutil.which("openssl") is None:
        pytest.skip("there is no openssl here")
    for name, purpose in (("daemon", "sslserver"), ("worker", "sslclient")):
        command = ["openssl", "verify", "-x509_strict", "-purpose", purpose, "-CAfile"]
        files = [str(keys / "ca.pem"), str(keys / name / "cert.pem")]
        done = subprocess.run([*command, *files], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def test_doctor_warns_before_keys_expire(keys):
    def levels(days):
        now = (NOW + timedelta(days=days)).timestamp()
        return {f.message.split('"')[1]: f.level for f in check_keys(keys, now, needed=True)}

    assert set(levels(0).values()) == {FindingLevel.OK}
    assert levels(710)["worker"] is FindingLevel.WARNING
    assert levels(731)["worker"] is FindingLevel.PROBLEM
    assert "viewer.anna" not in levels(0)
    (alone,) = check_keys(keys / "viewer", NOW.timestamp(), needed=True)
    assert alone.level is FindingLevel.OK


def test_doctor_misses_keys_only_where_they_are_needed(tmp_path):
    assert [*check_keys(tmp_path / "none", 0.0, needed=False)] == []
    assert [f.level for f in check_keys(tmp_path / "none", 0.0, needed=True)] == [
        FindingLevel.PROBLEM
    ]


# --- text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain \n\t text ä €", "plain \n\t text ä €"),
        ("\x1b[31mred\x07", "�[31mred�"),
        ("a\x00b\x7fc\x9bd", "a�b�c�d"),
        ("back\\u001bslash", "back\\u001bslash"),
        ("two\\\\\x1b", "two\\\\�"),
    ],
)
def test_control_characters_do_not_reach_terminals(text, shown):
    for escaped in (True, False):
        document = json.dumps([text], ensure_ascii=escaped).encode()
        assert json.loads(strip_control_characters(document)) == [shown]


def test_numbers_are_finite():
    for text in ("NaN", "Infinity", "-Infinity", "1e999", "1" + "0" * 400):
        with pytest.raises(ValueError, match="finite number"):
            codec.from_json(tuple[float, ...], f"[{text}]")
    assert codec.from_json(tuple[float, ...], b"[1e308, 2]") == (1e308, 2.0)


def test_what_is_infinite_on_purpose_travels():
    boundless = replace(ROBOT.drive, law="imposed", max_force=math.inf, max_torque=math.inf)
    text = codec.to_json(boundless)
    assert codec.from_json(Drive, text, exactly=True) == boundless
    with pytest.raises(ValueError, match="valid integer"):
        codec.from_json(Exact, b'{"count": "1"}', exactly=True)


@dataclass(frozen=True)
class Exact:
    count: int


def test_a_socket_of_somebody_else_is_not_connected_to(tmp_path, monkeypatch):
    (tmp_path / "daemon.sock").touch()
    me = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: me + 1)
    with pytest.raises(DaemonError, match="belongs to somebody else"):
        Client.open(f"unixsock-stream/{tmp_path}/daemon.sock")


def test_plain_tcp_that_is_asked_for_is_listened_at(tmp_path, monkeypatch):
    places = StatePaths(tmp_path)
    wide = "tcp/0.0.0.0:7447"
    assert prepare_endpoints(places, wide, insecure=True).endpoints == (places.endpoint, wide)
    monkeypatch.setenv("SCENARIO_INSECURE", "1")
    assert prepare_endpoints(places, wide).address == wide
    assert (
        prepare_endpoints(places).endpoints == prepare_endpoints(places, places.endpoint).endpoints
    )


def test_no_file_of_the_daemon_has_a_secret(daemon, keys):
    secrets = [path.read_text().splitlines()[1] for path in keys.rglob("key.pem")]
    files = [path for path in daemon.state.rglob("*") if path.is_file()]
    assert {"daemon.log", "ledger.db"} <= {path.name for path in files}
    written = b"".join(path.read_bytes() for path in files) + daemon.output.encode()
    assert [secret for secret in secrets if secret.encode() in written] == []
