"""The examination of what is damaged: it never fails, and believes no digest it has not taken."""

import random
import shutil
import sqlite3
import time
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from daemon.batch.errors import DaemonError, KeysUnusable
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.operation import FindingLevel, check_keys, examine
from daemon.batch.paths import Endpoint, StatePaths, find_endpoint
from daemon.batch.permissions import refuse_exposed_keys
from daemon.model.messages import Completion
from grammars.text import codec
from tests.make import SCENE, make_result, make_submission

NOBODY = Endpoint("tcp/127.0.0.1:1", "default")
NOW = time.time()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A state directory with six runs, four of which have results."""
    places = StatePaths(tmp_path_factory.mktemp("recorded") / "state")
    places.make_folders()
    places.scene(SCENE.digest).write_bytes(codec.to_json(SCENE))
    with LedgerWriter.open(places) as ledger:
        ledger.submit(make_submission("c", 6), NOW)
        for lease in ledger.lease("w", 4, NOW):
            result = make_result(lease.spec)
            done = Completion("w", lease.run, lease.attempt, lease.token, result)
            ledger.complete(done, NOW)
    return places


@pytest.fixture
def places(recorded, tmp_path):
    return StatePaths(Path(shutil.copytree(recorded.state, tmp_path / "state")))


def worries(places, **how):
    found = examine(places, NOBODY, **how)
    told = [f for f in found if f.level is not FindingLevel.OK]
    assert all(finding.remedy for finding in told)
    return [f for f in told if f.subject != "kernels"]


def change(places, *statements):
    with closing(sqlite3.connect(places.ledger)) as db, db:
        for statement in statements:
            db.execute(statement)


@pytest.mark.parametrize("how", [{}, {"quick": True}, {"traces": True}])
def test_a_healthy_place_is_whole(places, how):
    assert worries(places, **how) == []


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        (
            "UPDATE result SET body = CAST(replace(body, '0.5', '0.7') AS BLOB)",
            "results differ from their digest: c.0, c.1, c.2 and 1 more",
        ),
        (
            "UPDATE result SET body = CAST(replace(body, '\"lower\":0.5', '\"lower\":0.6') AS BLOB)"
            " WHERE run = 'c.1'",
            "results differ from their digest: c.1",
        ),
        ("UPDATE run SET margin = 9.5 WHERE id = 'c.2'", "differ from their results: c.2"),
        ("UPDATE run SET oracle = 'near' WHERE id = 'c.0'", "differ from their results: c.0"),
        ("UPDATE run SET simulated = 1 WHERE id = 'c.0'", "differ from their results: c.0"),
        ("UPDATE run SET outcome = 'fail' WHERE id = 'c.3'", "differ from their results: c.3"),
        ("UPDATE result SET body = x'7b7d' WHERE run = 'c.0'", "results cannot be read: c.0"),
        ("UPDATE run SET digest = id WHERE id = 'c.5'", "differ from their digest: c.5"),
        (
            "UPDATE run SET seed = '6' WHERE id = 'c.5'",
            "specifications differ",
        ),
        ("UPDATE run SET repeat = 7 WHERE id = 'c.5'", "from their digest: c.5"),
        ("UPDATE cell SET body = CAST(replace(body, 'disc', 'disk') AS BLOB)", "c.0, c.1, c.2"),
        ("UPDATE cell SET body = x'5b22ff'", "specifications differ from their digest: c.0"),
        ("UPDATE script SET body = x'5b'", "specifications differ from their digest: c.0"),
    ],
)
def test_what_was_changed_afterwards_is_found(places, statement, words):
    change(places, statement)
    assert any(words in finding.message for finding in worries(places))


def test_scenes_files_and_traces_are_held_against_what_was_recorded(places):
    (places.files / ("a" * 64)).write_bytes(b"something else")
    trace = places.traces / "c" / "S1.pilot.0.mcap"
    trace.parent.mkdir()
    trace.write_bytes(b"more than nothing")
    said = " ".join(finding.message for finding in worries(places))
    assert f"files differ from their digest: {places.files}" in said
    assert f"traces have another size than was recorded: {trace}" in said
    trace.write_bytes(b"")
    assert "traces differ" not in " ".join(finding.message for finding in worries(places))
    assert "traces differ from their digest" in " ".join(
        finding.message for finding in worries(places, traces=True)
    )
    scene = places.scene(SCENE.digest)
    scene.write_bytes(scene.read_bytes()[:-2])
    assert "scenes differ" in " ".join(finding.message for finding in worries(places))
    scene.unlink()
    said = " ".join(finding.message for finding in worries(places))
    assert "1 scenes or files of runs that wait are gone" in said


def _mutate(data, chance):
    at, way = chance.randrange(len(data)), chance.randrange(4)
    if way == 0:
        data[at] ^= 1 << chance.randrange(8)
    elif way == 1:
        del data[at:]
    elif way == 2:
        data[at : at + 300] = chance.randbytes(len(data[at : at + 300]))
    else:
        del data[at : at + chance.randrange(1, 5000)]


def test_a_damaged_ledger_never_ends_the_examination_nor_the_daemon_in_a_traceback(
    recorded, tmp_path
):
    chance, found = random.Random(11), 0
    sound = recorded.ledger.read_bytes()
    for number in range(40):
        places = StatePaths(tmp_path / f"{number}")
        places.make_folders()
        data = bytearray(sound)
        _mutate(data, chance)
        places.ledger.write_bytes(data)
        places.ledger.chmod(0o600)
        found += any(f.level is FindingLevel.PROBLEM for f in worries(places))
        try:
            with LedgerReader.open(places) as reader:
                reader.campaigns()
            with LedgerWriter.open(places) as ledger:
                ledger.lapse(ledger.leases(), NOW)
                ledger.checkpoint()
        except DaemonError:
            continue
    # The others are in pages that nothing uses.
    assert found > 20


@pytest.mark.parametrize(
    ("spoil", "subject"),
    [
        (lambda p: p.ledger.write_bytes(b""), "ledger"),
        (lambda p: (p.ledger.unlink(), p.ledger.mkdir()), "ledger"),
        (lambda p: change(p, "PRAGMA user_version = 99"), "ledger"),
        (lambda p: p.contact_file.write_text('{"endpoint": "\x1b]0;", "pid": -1'), None),
        (lambda p: (p.spool / "dead" / "lock").mkdir(parents=True), "leftovers"),
        (lambda p: (p.spool / "dead").write_bytes(b""), None),
        (lambda p: (p.files.rmdir(), p.files.touch()), None),
        (lambda p: (shutil.rmtree(p.state), p.state.touch()), "state"),
    ],
)
def test_whatever_lies_there_is_a_line_with_a_remedy(places, spoil, subject):
    spoil(places)
    subjects = {f.subject for f in worries(places) if f.level is FindingLevel.PROBLEM}
    assert subjects == ({subject} if subject else set())
    find_endpoint(state=places.state, environ={})


def test_a_ledger_that_somebody_holds_is_not_called_damaged(places, monkeypatch):
    with ExitStack() as stack:
        db = stack.enter_context(closing(sqlite3.connect(places.ledger, isolation_level=None)))
        db.execute("PRAGMA locking_mode = EXCLUSIVE")
        db.execute("BEGIN EXCLUSIVE")
        monkeypatch.setattr("daemon.batch.ledger._connection._READER_PATIENCE", 0.01)
        (finding,) = (f for f in worries(places) if f.subject == "ledger")
    assert "just now" in finding.message
    assert "fuser" in finding.remedy


def test_keys_that_others_could_put_there_are_a_problem(tmp_path):
    keys = tmp_path / "keys"
    (keys / "worker.spare").mkdir(parents=True, mode=0o700)
    (keys / "worker.spare" / "key.pem").touch()
    (keys / "worker.spare" / "key.pem").chmod(0o640)  # whatever the umask is
    keys.chmod(0o770)
    told = [f.message for f in check_keys(keys, NOW, needed=True)]
    assert any(words.startswith(f"others can write {keys}") for words in told)
    assert any(words.startswith("others can read") for words in told)
    with pytest.raises(KeysUnusable, match="others can write"):
        refuse_exposed_keys(keys)
    keys.chmod(0o1777)  # as a cluster mounts secrets
    refuse_exposed_keys(keys)
