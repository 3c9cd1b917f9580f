"""The keys of machines, from the command line."""

import json
import re
import shlex
from pathlib import Path

import pytest

from daemon.batch.security._access_control import CLIENT_ROLES
from daemon.model.verbs import VERBS, Role

DOC = Path(__file__).parents[3] / "docs" / "security.md"


@pytest.fixture
def folder(scenario, tmp_path, monkeypatch):
    monkeypatch.setenv("SCENARIO_KEYS", str(tmp_path / "keys"))
    said = scenario("keys", "init", "--host", "server")
    assert said.code == 0, said.err
    assert "server localhost 127.0.0.1 ::1" in said.out
    return tmp_path / "keys"


def test_keys_are_made_issued_listed_and_revoked(scenario, folder):
    assert scenario("keys", "issue", "worker", "spare").code == 0
    revoked = json.loads(scenario("keys", "revoke", "worker.spare", "--json").out)
    assert [(key["name"], key["revoked_at"] is None) for key in revoked["keys"]] == [
        ("worker.spare", False)
    ]
    listed = scenario("keys", "list")
    assert [line.split()[0] for line in listed.out.splitlines() if "─" not in line] == [
        "key", "viewer", "operator", "worker", "daemon", "worker.spare",
    ]  # fmt: skip
    assert re.search(r"worker.spare +worker +revoked", listed.out)
    told = json.loads(scenario("keys", "list", "--json").out)
    assert told["folder"] == str(folder)
    assert {key["role"] for key in told["keys"]} == set(Role)
    assert all(len(key["fingerprint"]) == 64 for key in told["keys"])


def test_the_next_step_is_one_that_works(scenario, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = scenario("keys", "init", str(tmp_path / "my keys")).err
    found = re.search("next: `scenario (.*?)`", " ".join(said.split()))
    assert found
    assert scenario(*shlex.split(found[1])).code == 0
    assert (tmp_path / "worker.tar").exists()


def test_the_documentation_says_what_each_role_may_do():
    expected = []
    for name, verb in VERBS.items():
        marks = "".join("| yes " if role in verb.roles else "| " for role in CLIENT_ROLES)
        size = verb.largest // 2**10
        told = f"{size} KiB" if size < 1024 else f"{size // 1024} MiB"
        expected.append(f"| `{name}` {marks}| {told} |")
    table = DOC.read_text("utf-8").partition("| request |")[2].partition("\n\n")[0]
    assert table.splitlines()[2:] == expected
