"""Who may do what, where one listens and connects, which keys are taken, what terminals get."""

import json
import math
import os
import shutil
import stat
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import pytest

from daemon.batch.client import Client
from daemon.batch.errors import DaemonError, KeysUnusable, Refused
from daemon.batch.paths import StatePaths, is_endpoint, is_local
from daemon.batch.security import (
    access_control,
    find_credentials,
    find_daemon_credentials,
    load_register,
    strip_control_characters,
)
from daemon.batch.security._access_control import allowed_verbs
from daemon.batch.security.authority import create_authority, issue_key, pack_key, revoke_key
from daemon.batch.server import exposure_warning
from daemon.batch.server._dispatcher import RevokedKeys
from daemon.batch.server._opening import prepare_endpoints
from daemon.batch.server._runtime import EventLog
from daemon.model.verbs import Role
from grammars.model.robot import Drive
from grammars.text import codec
from tests.batch.parts.test_security import unpacked
from tests.make import ROBOT

NOW = datetime.now(UTC).replace(microsecond=0)


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """Keys of everybody; "anna" is revoked."""
    folder = tmp_path_factory.mktemp("keys") / "all"
    create_authority(folder, ("localhost", "127.0.0.1"), NOW)
    issue_key(folder, Role.VIEWER, "anna", (), NOW)
    revoke_key(folder, "viewer.anna", NOW)
    return folder


# --- who may listen and connect where


def test_insecure_is_said_aloud():
    assert exposure_warning("tcp/0.0.0.0:1").startswith("INSECURE: everybody in the network")
    assert "an account on this machine" in exposure_warning("tcp/127.0.0.1:1")
    assert exposure_warning("tls/0.0.0.0:1") == exposure_warning("") == ""


def test_nobody_speaks_plain_tcp_to_another_machine_by_mistake():
    with pytest.raises(DaemonError, match="use tls/ with keys"):
        Client.open("tcp/192.0.2.1:7447")


@pytest.mark.parametrize(
    ("endpoint", "valid", "local"),
    [
        ("tcp/127.0.0.9:1", True, True),
        ("tcp/[::1]:1", True, True),
        ("tcp/localhost:1", True, True),
        ("unixsock-stream//run/scenario/daemon.sock", True, True),
        ("tcp/192.0.2.7:7447", True, False),
        ("tcp/127.0.0.1.example.org:1", True, False),
        ("tcp/[::]:1", True, False),
        ("tcp/0.0.0.0:1", True, False),
        ("tls/server:7447", True, False),
        # An endpoint carries no settings for the bus.
        ("tcp/h:1#iface=eth0", False, False),
        ("tls/h:1?rel=0", False, False),
        ("unixsock-stream//a#b", False, None),
        ("unixsock-stream//a\x00", False, None),
        ("unixsock-stream/relative", False, None),
        ("tls/h:1\n", False, False),
        ("127.0.0.1:7447", False, None),
        ("tcp/host", False, None),
        ("tcp/host:70000", False, None),
        ("udp/h:1", False, None),
    ],
)
def test_an_endpoint_is_one_and_of_this_machine(endpoint, valid, local):
    assert is_endpoint(endpoint) == valid
    assert local is None or is_local(endpoint) == local


def test_plain_tcp_that_is_asked_for_is_listened_at(tmp_path, monkeypatch):
    places, wide = StatePaths(tmp_path), "tcp/0.0.0.0:7447"
    assert prepare_endpoints(places, wide, insecure=True).endpoints == (places.endpoint, wide)
    monkeypatch.setenv("SCENARIO_INSECURE", "1")
    assert prepare_endpoints(places, wide).address == wide
    own = prepare_endpoints(places, places.endpoint)
    assert prepare_endpoints(places).endpoints == own.endpoints


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


def test_a_socket_of_somebody_else_is_not_connected_to(tmp_path, monkeypatch):
    (tmp_path / "daemon.sock").touch()
    me = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: me + 1)
    with pytest.raises(DaemonError, match="belongs to somebody else"):
        Client.open(f"unixsock-stream/{tmp_path}/daemon.sock")


# --- the rules


def test_viewers_change_nothing_and_only_workers_touch_leases():
    steering = {"submit", "cancel", "retry", "acknowledge", "steer", "shutdown"}
    working = {"welcome", "lease", "renew", "complete", "release"}
    assert not set(allowed_verbs(Role.VIEWER)) & (steering | working | {"put"})
    assert set(allowed_verbs(Role.VIEWER)) < set(allowed_verbs(Role.OPERATOR))
    assert set(allowed_verbs(Role.OPERATOR)) & (steering | working) == steering
    assert set(allowed_verbs(Role.WORKER)) == working | {"get", "put"}
    assert allowed_verbs(Role.DAEMON) == ()


def test_access_control_knows_valid_keys_only(keys):
    made = json.loads(json.dumps(access_control(load_register(keys))))
    names = [name for one in made["subjects"] for name in one.get("cert_common_names", ())]
    assert sorted(names) == ["operator", "viewer", "worker"]
    assert made["default_permission"] == "deny"


# --- keys


def test_keys_are_private_and_never_overwritten(keys):
    for path in keys.rglob("*"):
        assert not path.stat().st_mode & 0o077 or path.name == "register.json", path
    before = {path: path.read_bytes() for path in keys.rglob("*.pem")}
    with pytest.raises(KeysUnusable, match="has keys already"):
        create_authority(keys, ("localhost",), NOW)
    with pytest.raises(KeysUnusable, match='"worker" exists'):
        issue_key(keys, Role.WORKER, "", (), NOW)
    with pytest.raises(KeysUnusable, match="was revoked: choose another name"):
        issue_key(keys, Role.VIEWER, "anna", (), NOW)
    assert {path: path.read_bytes() for path in keys.rglob("*.pem")} == before


@pytest.mark.parametrize("name", ["../x", "A", "a.b", "x" * 41, "a b", "-a", "a\n"])
def test_the_name_of_a_key_must_be_one(keys, name):
    with pytest.raises(KeysUnusable, match="is not a valid name of a key"):
        issue_key(keys, Role.VIEWER, name, (), NOW)


@pytest.mark.parametrize("host", ["", "a b", "*", "-x", "a/b", "x" * 300])
def test_the_host_of_a_daemon_must_be_one(tmp_path, host):
    with pytest.raises(KeysUnusable, match="neither the name of a host nor an address"):
        create_authority(tmp_path / "keys", (host,), NOW)
    assert not (tmp_path / "keys").exists()


def test_damaged_keys_are_said_and_those_others_can_read_are_not_used(keys, tmp_path):
    mine = tmp_path / "keys"
    shutil.copytree(keys, mine)
    (mine / "viewer" / "key.pem").chmod(0o640)
    with pytest.raises(KeysUnusable, match="others can read"):
        find_credentials(Role.VIEWER, mine / "viewer")
    (mine / "viewer" / "key.pem").chmod(0o600)
    (mine / "viewer" / "cert.pem").write_text("nonsense")
    with pytest.raises(KeysUnusable, match="is not one of our certificates"):
        find_credentials(Role.VIEWER, mine)
    (mine / "register.json").write_text("{")
    with pytest.raises(KeysUnusable, match=r"register.json is damaged"):
        find_daemon_credentials(mine)
    (mine / "ca.key").unlink()
    with pytest.raises(KeysUnusable, match="has no authority"):
        issue_key(mine, Role.VIEWER, "late", (), NOW)


def test_a_bundle_unpacks_into_a_key_and_is_never_overwritten(keys, tmp_path):
    archive = tmp_path / "worker.tar"
    assert find_credentials(Role.WORKER, unpacked(keys, "worker", tmp_path)).name == "worker"
    assert stat.S_IMODE(archive.stat().st_mode) == 0o600
    for refused in ("worker.unknown", "viewer.anna", "../worker"):
        with pytest.raises(KeysUnusable, match="there is no key"):
            pack_key(keys, refused, tmp_path / "other.tar")
    with pytest.raises(KeysUnusable, match="exists already"):
        pack_key(keys, "worker", archive)
    there = unpacked(keys, "daemon", tmp_path)
    assert find_daemon_credentials(there).credentials.role is Role.DAEMON


def test_the_key_of_a_worker_makes_no_daemon(keys, tmp_path):
    shutil.copytree(keys / "worker", tmp_path / "worker")
    shutil.copy(keys / "register.json", tmp_path / "worker" / "register.json")
    with pytest.raises(KeysUnusable, match="not one of a daemon"):
        find_daemon_credentials(tmp_path / "worker")


@pytest.fixture
def log(tmp_path):
    made = EventLog(tmp_path / "log")
    yield made
    made.close()


def test_who_was_revoked_is_not_heard_any_more(tmp_path, log):
    folder, now = tmp_path / "keys", [100.0]
    create_authority(folder, ("localhost",), NOW)
    revoked = RevokedKeys(log, find_daemon_credentials(folder), lambda: now[0])
    register = folder / "register.json"
    before = register.read_bytes()
    revoked.look()
    revoke_key(folder, "worker", NOW)
    assert revoked.problem("worker") is None
    # Neither a register of before nor none at all makes anybody come back.
    for spoil in (
        lambda: None,
        lambda: register.write_bytes(before),
        (folder / "ca.key").touch,
        register.unlink,
    ):
        spoil()
        now[0] += 1.0
        revoked.look()
        assert type(revoked.problem("worker")) is Refused
        assert 'the key "worker" was revoked' in str(revoked.problem("worker"))
        assert revoked.problem("viewer") is None


def test_without_keys_there_is_nobody_but_the_owner(log):
    revoked = RevokedKeys(log)
    assert revoked.problem("owner") is None
    for name in ("worker", "*", "", "x" * 1000):
        assert str(revoked.problem(name)).startswith("this daemon does not know the key")


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


def test_numbers_are_finite_unless_they_are_infinite_on_purpose():
    for text in ("NaN", "Infinity", "-Infinity", "1e999", "1" + "0" * 400):
        with pytest.raises(ValueError, match="finite number"):
            codec.from_json(tuple[float, ...], f"[{text}]")
    assert codec.from_json(tuple[float, ...], b"[1e308, 2]") == (1e308, 2.0)
    boundless = replace(ROBOT.drive, law="imposed", max_force=math.inf, max_torque=math.inf)
    assert codec.from_json(Drive, codec.to_json(boundless), exactly=True) == boundless
    with pytest.raises(ValueError, match="valid integer"):
        codec.from_json(Exact, b'{"count": "1"}', exactly=True)


@dataclass(frozen=True)
class Exact:
    count: int
