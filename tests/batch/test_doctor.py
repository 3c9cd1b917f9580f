"""The examination of a state directory: it finds what is wrong, never fails, changes nothing."""

import fcntl
import os
import random
import shutil
import sqlite3
import time
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import pytest

from daemon.batch.doctor import FindingLevel, _answering, check_keys, examine
from daemon.batch.errors import DaemonError, KeysUnusable
from daemon.batch.ledger import LedgerReader, LedgerWriter
from daemon.batch.paths import Endpoint, StatePaths, find_endpoint
from daemon.batch.permissions import refuse_exposed_keys
from daemon.batch.security.authority import create_authority, issue_key, revoke_key
from daemon.model.messages import Completion
from daemon.model.status import DaemonOverview, Trouble, TroubleCause
from daemon.model.verbs import Role
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


def found(places, subject="", endpoint=NOBODY, **how):
    """Findings about a subject, or those that are worries."""
    findings = examine(places, endpoint, **how)
    assert all((f.remedy == "") == (f.level is FindingLevel.OK) for f in findings)
    if subject:
        return [f for f in findings if f.subject == subject]
    return [f for f in findings if f.level is not FindingLevel.OK and f.subject != "kernels"]


def words_of(places, **how):
    return " ".join(finding.message for finding in found(places, **how))


def change(places, *statements):
    with closing(sqlite3.connect(places.ledger)) as db, db:
        for statement in statements:
            db.execute(statement)


@pytest.mark.parametrize("how", [{}, {"quick": True}, {"traces": True}])
def test_a_healthy_place_is_whole_and_not_changed(places, how):
    before = {path: path.read_bytes() for path in places.state.rglob("*") if path.is_file()}
    assert found(places, **how) == []
    assert "6 runs, 4 results" in found(places, "ledger")[0].message
    after = {path: path.read_bytes() for path in places.state.rglob("*") if path.is_file()}
    assert before.items() <= after.items()


def test_a_place_that_is_not_there_yet_is_fine(tmp_path):
    places = StatePaths(tmp_path / "later")
    findings = examine(places, NOBODY)
    assert not any(f.level is FindingLevel.PROBLEM for f in findings)
    assert not places.state.exists()


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        (
            "UPDATE result SET body = CAST(replace(body, '0.5', '0.7') AS BLOB)",
            "results differ from their digest: c.0, c.1, c.2 and 1 more",
        ),
        ("UPDATE run SET margin = 9.5 WHERE id = 'c.2'", "differ from their results: c.2"),
        ("UPDATE run SET oracle = 'near' WHERE id = 'c.0'", "differ from their results: c.0"),
        ("UPDATE run SET simulated = 1 WHERE id = 'c.0'", "differ from their results: c.0"),
        ("UPDATE run SET outcome = 'fail' WHERE id = 'c.3'", "differ from their results: c.3"),
        ("UPDATE result SET body = x'7b7d' WHERE run = 'c.0'", "results cannot be read: c.0"),
        ("UPDATE run SET digest = id WHERE id = 'c.5'", "differ from their digest: c.5"),
        ("UPDATE run SET seed = '6' WHERE id = 'c.5'", "specifications differ"),
        ("UPDATE run SET repeat = 7 WHERE id = 'c.5'", "from their digest: c.5"),
        ("UPDATE cell SET body = CAST(replace(body, 'disc', 'disk') AS BLOB)", "c.0, c.1, c.2"),
        ("UPDATE cell SET body = x'5b22ff'", "specifications differ from their digest: c.0"),
        ("UPDATE script SET body = x'5b'", "specifications differ from their digest: c.0"),
        ("DELETE FROM campaign", "refers to nothing"),
        ("UPDATE event SET at = at + 7200", "before the ledger's newest event"),
    ],
)
def test_what_was_changed_afterwards_is_found(places, statement, words):
    change(places, statement)
    assert words in words_of(places)


def test_scenes_files_and_traces_are_held_against_what_was_recorded(places):
    (places.files / ("a" * 64)).write_bytes(b"something else")
    trace = places.traces / "c" / "S1.pilot.0.mcap"
    trace.parent.mkdir()
    trace.write_bytes(b"more than nothing")
    said = words_of(places)
    assert f"files differ from their digest: {places.files}" in said
    assert f"traces have another size than was recorded: {trace}" in said
    trace.write_bytes(b"")
    assert "traces differ" not in words_of(places)
    assert "traces differ from their digest" in words_of(places, traces=True)
    scene = places.scene(SCENE.digest)
    scene.write_bytes(scene.read_bytes()[:-2])
    assert "scenes differ" in words_of(places)
    scene.unlink()
    assert "1 scenes or files of waiting runs are missing" in words_of(places)


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
    chance, problems = random.Random(11), 0
    sound = recorded.ledger.read_bytes()
    for number in range(20):
        places = StatePaths(tmp_path / f"{number}")
        places.make_folders()
        data = bytearray(sound)
        _mutate(data, chance)
        places.ledger.write_bytes(data)
        places.ledger.chmod(0o600)
        problems += any(f.level is FindingLevel.PROBLEM for f in found(places))
        try:
            with LedgerReader.open(places) as reader:
                reader.campaigns()
            with LedgerWriter.open(places) as ledger:
                ledger.lapse(ledger.leases(), NOW)
                ledger.checkpoint()
        except DaemonError:
            continue
    # The others are in pages that nothing uses.
    assert problems > 10


@pytest.mark.parametrize(
    ("spoil", "subject"),
    [
        (lambda p: p.ledger.write_bytes(b""), "ledger"),
        (lambda p: p.ledger.write_bytes(b"?" * 9000), "ledger"),
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
    subjects = {f.subject for f in found(places) if f.level is FindingLevel.PROBLEM}
    assert subjects == ({subject} if subject else set())
    find_endpoint(state=places.state)


def test_a_ledger_that_somebody_holds_is_not_called_damaged(places, monkeypatch):
    with closing(sqlite3.connect(places.ledger, isolation_level=None)) as db:
        db.execute("PRAGMA locking_mode = EXCLUSIVE")
        db.execute("BEGIN EXCLUSIVE")
        monkeypatch.setattr("daemon.batch.ledger._connection._READER_PATIENCE", 0.01)
        (finding,) = found(places, "ledger")
    assert "cannot be read now" in finding.message
    assert "fuser" in finding.remedy


def test_what_others_can_write_is_a_problem(places):
    places.traces.chmod(0o777)
    (finding,) = found(places, "state")
    remedy = f"chmod -R go-rwx {places.state}"
    assert (finding.level, finding.remedy) == (FindingLevel.PROBLEM, remedy)


def test_leftovers_are_named_unless_somebody_uses_them(places):
    partial = places.traces / "known" / "a.mcap.partial"
    dead, living = places.spool / "dead-1", places.spool / "living-1"
    for folder in (partial.parent, dead, living):
        folder.mkdir(parents=True)
    for file in (partial, dead / "lock", living / "lock"):
        file.touch()
    os.utime(partial, (0.0, 0.0))
    with (living / "lock").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        messages = " ".join(finding.message for finding in found(places, "leftovers"))
    assert all(str(path) in messages for path in (partial, dead))
    assert str(living) not in messages


def test_what_was_moved_aside_is_counted_and_named(places):
    elsewhere = places.cache("another-daemon")
    aside = []
    for paths in (places, elsewhere):
        paths.scenes.mkdir(parents=True, exist_ok=True)
        (paths.scenes / "damaged.json").touch()
        aside.append(paths.put_aside(paths.scenes / "damaged.json"))
    (finding,) = found(places, "leftovers")
    assert finding.level is FindingLevel.WARNING
    assert "moved aside, damaged or not removable, 2: " in finding.message
    assert all(str(path) in finding.message for path in aside)


def test_a_daemon_that_does_not_answer_is_told_apart_from_one_that_is_gone(places):
    contact = '{"endpoint": "tcp/127.0.0.1:1", "pid": %d, "version": "0", "started_at": 0.0}'
    told = Endpoint("tcp/127.0.0.1:1", "daemon.json")
    asked = Endpoint("tcp/127.0.0.1:1", "--connect")
    assert found(places, "daemon")[0].level is FindingLevel.OK
    places.contact_file.write_text(contact % 2**22)
    assert found(places, "daemon", told)[0].level is FindingLevel.WARNING
    with places.lock.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert found(places, "daemon", told)[0].level is FindingLevel.PROBLEM
    assert found(places, "daemon", asked)[0].level is FindingLevel.PROBLEM


@pytest.mark.parametrize(
    ("cause", "remedy"),
    [
        (TroubleCause.SPACE, "scenario gc"),
        (TroubleCause.WORKER, "check its machine"),
        (TroubleCause.INPUT, "scenario submit"),
        (TroubleCause.OTHER, "worker.log"),
    ],
)
def test_the_cause_of_a_trouble_and_not_its_words_decides_its_remedy(places, cause, remedy):
    words = ("worker processes cannot be forked", "the disk of another is full")
    troubles = tuple(Trouble(one, cause) for one in words)
    # From version to seconds_left.
    others = ("0", str(places.state), 0.0, 0.0, 0, 1, 0.0, None)
    overview = DaemonOverview(*(0,) * 9, *others, halted=True, troubles=troubles)
    findings = list(_answering(overview, places, NOBODY))[1:]
    assert [finding.level for finding in findings] == [FindingLevel.PROBLEM, FindingLevel.WARNING]
    assert all(remedy in finding.remedy for finding in findings)


def test_an_endpoint_is_judged(places):
    far = Endpoint("tcp/192.0.2.1:x", "SCENARIO_CONNECT")
    assert found(places, "endpoint", far)[0].level is FindingLevel.PROBLEM
    assert found(places, "endpoint")[0].level is FindingLevel.OK
    here = Endpoint(places.endpoint, "default")
    path = f"{places.endpoint.removeprefix('unixsock-stream/')}, from default"
    assert found(places, "endpoint", here)[0].message == path
    wrong = Endpoint("unixsock-stream/nowhere", "SCENARIO_CONNECT")
    assert found(places, "endpoint", wrong)[0].message.startswith("unixsock-stream/nowhere, from")


# --- keys


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


def test_it_warns_before_keys_expire(tmp_path):
    now, keys = datetime.fromtimestamp(int(NOW), UTC), tmp_path / "keys"
    create_authority(keys, ("localhost",), now)
    issue_key(keys, Role.VIEWER, "anna", (), now)
    revoke_key(keys, "viewer.anna", now)

    def levels(days):
        findings = check_keys(keys, NOW + 86_400.0 * days, needed=True)
        return {f.message.split('"')[1]: f.level for f in findings}

    assert set(levels(0).values()) == {FindingLevel.OK}
    assert levels(710)["worker"] is FindingLevel.WARNING
    assert levels(731)["worker"] is FindingLevel.PROBLEM
    assert "viewer.anna" not in levels(0)
    (alone,) = check_keys(keys / "viewer", NOW, needed=True)
    assert alone.level is FindingLevel.OK


@pytest.mark.parametrize(("needed", "levels"), [(False, []), (True, [FindingLevel.PROBLEM])])
def test_keys_are_missed_only_where_they_are_needed(tmp_path, needed, levels):
    assert [f.level for f in check_keys(tmp_path / "none", 0.0, needed=needed)] == levels
