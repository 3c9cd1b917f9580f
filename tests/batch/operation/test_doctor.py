"""The examination finds what is wrong, says what to do, and changes nothing."""

import fcntl
import os
import sqlite3
import time
from contextlib import closing

import pytest

from daemon.batch.ledger import LedgerWriter, connect
from daemon.batch.operation import FindingLevel, examine
from daemon.batch.operation._doctor import _answering
from daemon.batch.paths import Endpoint, StatePaths
from daemon.model.status import DaemonOverview, Trouble, TroubleCause
from grammars.text import codec
from tests.make import SCENE, make_submission

NOBODY = Endpoint("tcp/127.0.0.1:1", "default")


@pytest.fixture
def places(tmp_path):
    """A state directory after three runs were queued."""
    places = StatePaths(tmp_path / "state")
    places.make_folders()
    places.scene(SCENE.digest).write_bytes(codec.to_json(SCENE))
    db = connect(places.ledger)
    LedgerWriter(db).submit(make_submission("known", 3), time.time())
    db.close()
    return places


def found(places, subject, endpoint=NOBODY):
    findings = examine(places, endpoint)
    assert all((f.remedy == "") == (f.level is FindingLevel.OK) for f in findings)
    return tuple(f for f in findings if f.subject == subject)


def test_a_healthy_place_has_no_problem_and_is_not_changed(places):
    before = {path: path.read_bytes() for path in places.state.rglob("*") if path.is_file()}
    findings = examine(places, NOBODY)
    assert {f.subject: f.level for f in findings if f.level is FindingLevel.PROBLEM} == {}
    (ledger,) = (f for f in findings if f.subject == "ledger")
    assert "3 runs, 0 results" in ledger.message
    after = {path: path.read_bytes() for path in places.state.rglob("*") if path.is_file()}
    assert before.items() <= after.items()


def _tear(path):
    with path.open("r+b") as file:
        file.seek(4096 * 3)
        file.write(b"\xa5" * 4096 * 3)


def _drop_campaigns(path):
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("DELETE FROM campaign")


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (_tear, "ledger"),
        (lambda path: path.write_bytes(b"?" * 9000), "cannot be read: file is not a database"),
        (_drop_campaigns, "refers to nothing"),
    ],
)
def test_a_damaged_ledger_is_a_problem(places, damage, words):
    damage(places.ledger)
    (finding,) = found(places, "ledger")
    assert finding.level is FindingLevel.PROBLEM
    assert words in f"{finding.subject} {finding.message}"


def test_a_clock_that_was_set_back_is_a_problem(places):
    with closing(sqlite3.connect(places.ledger)) as db, db:
        db.execute("UPDATE event SET at = ?", (time.time() + 3600.0,))
    (finding,) = found(places, "clock")
    assert (finding.level, "before the ledger's newest event" in finding.message) == (
        FindingLevel.PROBLEM, True,
    )  # fmt: skip


def test_what_others_can_write_is_a_problem(places):
    places.traces.chmod(0o777)
    (finding,) = found(places, "state")
    assert (finding.level, finding.remedy) == (
        FindingLevel.PROBLEM,
        f"chmod -R go-rwx {places.state}",
    )


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
    for paths in (places, elsewhere):
        paths.scenes.mkdir(parents=True, exist_ok=True)
        (paths.scenes / "damaged.json").touch()
    aside = [paths.put_aside(paths.scenes / "damaged.json") for paths in (places, elsewhere)]
    (finding,) = found(places, "leftovers")
    assert finding.level is FindingLevel.WARNING
    assert "moved aside, damaged or not removable, 2: " in finding.message
    assert all(str(path) in finding.message for path in aside)


def test_a_daemon_that_does_not_answer_is_told_apart_from_one_that_is_gone(places):
    contact = '{"endpoint": "tcp/127.0.0.1:1", "pid": %d, "version": "0", "started_at": 0.0}'
    told = Endpoint("tcp/127.0.0.1:1", "daemon.json")
    assert found(places, "daemon")[0].level is FindingLevel.OK
    places.contact_file.write_text(contact % 2**22)
    assert found(places, "daemon", told)[0].level is FindingLevel.WARNING
    with places.lock.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert found(places, "daemon", told)[0].level is FindingLevel.PROBLEM
    asked = Endpoint("tcp/127.0.0.1:1", "--connect")
    assert found(places, "daemon", asked)[0].level is FindingLevel.PROBLEM


@pytest.mark.parametrize(
    ("cause", "remedy"),
    [
        (TroubleCause.SPACE, "scenario gc"),
        (TroubleCause.WORKER, "see to its machine"),
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


def test_a_place_that_is_not_there_yet_is_fine(tmp_path):
    places = StatePaths(tmp_path / "later")
    findings = examine(places, NOBODY)
    assert not any(f.level is FindingLevel.PROBLEM for f in findings)
    assert not places.state.exists()
