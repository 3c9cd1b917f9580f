"""What nobody needs goes, and nothing else does."""

import fcntl
import os
import time

import pytest

from daemon.batch.errors import DaemonError
from daemon.batch.ledger import LedgerWriter, find_strays, remove_strays
from daemon.batch.paths import StatePaths
from daemon.batch.server._submissions import admit_submission
from grammars.text import codec
from tests.make import SCENE, make_submission

HOUR = 3600.0
WEEK = 7 * 24 * HOUR
UNKNOWN = "e" * 64


@pytest.fixture
def places(tmp_path):
    """A state directory with a campaign that has one scene and one file."""
    places = StatePaths(tmp_path / "state")
    places.make_folders()
    places.scene(SCENE.digest).write_bytes(codec.to_json(SCENE))
    needed = places.files / ("a" * 64)
    needed.touch()
    files = {"files": {"wheels": needed.name}}
    with LedgerWriter.open(places) as ledger:
        ledger.submit(make_submission("known", 2, **files), time.time())
        ledger.submit(make_submission("deleted", 1), time.time())
        ledger.cancel("deleted", time.time())
        ledger.delete(("deleted",), time.time())
    return places


def leave(path, age, text=""):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    os.utime(path, (time.time() - age,) * 2)
    return path


def leave_folder(path, age):
    path.mkdir(parents=True)
    os.utime(path, (time.time() - age,) * 2)
    return path


def leave_deleted(places):
    """Traces of a campaign that was deleted by a daemon that died before they were gone."""
    folder = places.traces / "deleted"
    leave(folder / "S1.pilot.0.mcap", 2 * HOUR)
    os.utime(folder, (time.time() - 2 * HOUR,) * 2)
    return folder


def leave_strays(places):
    """One of each kind, old enough to go; folders come last, or they would be young again."""
    work = StatePaths(places.state / "work" / "elsewhere")
    strays = {
        leave(places.incoming / f"known.0.7.{UNKNOWN}.part", 2 * HOUR, "some bytes"),
        leave(places.state / ".daemon.json.0a1b2c3d.tmp", 2 * HOUR),
        leave(places.scenes / f".{UNKNOWN}.json.0a1b2c3d.tmp", 2 * HOUR),
        leave(places.incoming / f"{UNKNOWN}.part", 2 * HOUR),
        leave(places.traces / "known" / "S1.pilot.0.mcap.partial", 2 * HOUR),
        leave(places.scenes / f"{UNKNOWN}.json", 2 * HOUR),
        leave(places.files / UNKNOWN, 2 * HOUR),
        leave(work.files / f".{UNKNOWN}.0a1b2c3d.tmp", 2 * HOUR),
        leave(work.scenes / f"{UNKNOWN}.json", 5 * WEEK),
        leave_folder(places.traces / "removed", 2 * HOUR),
        leave_deleted(places),
        leave_folder(places.spool / "dead-1", 2 * WEEK),
        leave_folder(work.spool / "dead-2", 2 * WEEK),
    }
    assert len(strays) == 13
    return strays


def keep(places):
    """What looks like them and stays: young, in use, or of a campaign."""
    kept = {
        leave(places.incoming / f"known.1.7.{UNKNOWN}.part", 0.1 * HOUR),
        leave(places.scenes / f".{SCENE.digest}.json.0a1b2c3d.tmp", 0.1 * HOUR),
        leave(places.scenes / f"{'f' * 64}.json", 0.1 * HOUR),
        leave(places.scene(SCENE.digest), 2 * WEEK, "as it was"),
        leave(places.files / ("a" * 64), 2 * WEEK),
        leave(places.traces / "known" / "S1.pilot.1.mcap", 2 * WEEK),
        leave(places.spool / "dead-3" / "lock", 2 * HOUR),
        leave_folder(places.spool / "dead-3" / "known.0", 2 * HOUR),
        leave(places.state / "notes.tmp", 2 * WEEK),
        leave_folder(places.traces / "fresh", 0.1 * HOUR),
    }
    os.utime(places.spool / "dead-3", (time.time() - 2 * HOUR,) * 2)
    return kept


def test_strays_go_and_nothing_else(places):
    kept = keep(places)
    busy = leave(places.spool / "living" / "lock", 2 * WEEK)
    leave_folder(places.traces / "known-too", 0)
    strays = leave_strays(places)
    os.utime(busy.parent, (time.time() - 2 * WEEK,) * 2)
    with busy.open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        found = find_strays(places, time.time())
        assert {stray.path for stray in found} == strays
        assert sum(stray.bytes for stray in found) == len("some bytes")
        assert {stray.path for stray in remove_strays(places, time.time())} == strays
        assert find_strays(places, time.time()) == ()
    assert not any(path.exists() for path in strays)
    assert all(path.exists() for path in (*kept, busy))


def test_a_finished_run_waits_in_the_spool_however_long(places):
    """Its ledger may return, or its daemon: nothing but an answer makes it superfluous."""
    for spool in (places.spool, StatePaths(places.state / "work" / "elsewhere").spool):
        attempt = spool / "dead" / "known.0" / "attempt-1.7"
        result = leave(attempt / "result.json", 5 * WEEK)
        for folder in (attempt, attempt.parent, attempt.parent.parent):
            os.utime(folder, (time.time() - 5 * WEEK,) * 2)
        assert remove_strays(places, time.time()) == ()
        assert result.exists()


def test_a_campaign_on_its_way_keeps_what_it_needs(places):
    for name in (f"{UNKNOWN}.json", f"{SCENE.digest}.json"):
        leave(places.scenes / name, 2 * HOUR)
    submission = make_submission("next", 1, files={"wheels": UNKNOWN})
    leave(places.files / UNKNOWN, 2 * HOUR)
    admit_submission(submission, places)
    gone = {stray.path for stray in remove_strays(places, time.time())}
    assert gone == {places.scenes / f"{UNKNOWN}.json"}
    assert (places.files / UNKNOWN).exists()


def test_nothing_goes_when_nobody_says_what_is_needed(places, tmp_path):
    old = leave(places.scenes / f"{UNKNOWN}.json", 2 * HOUR)
    data = bytearray(places.ledger.read_bytes())
    data[4096:] = b"\xff" * len(data[4096:])
    places.ledger.write_bytes(data)
    with pytest.raises(DaemonError):
        remove_strays(places, time.time())
    assert old.exists()
    with pytest.raises(DaemonError, match="there is no ledger"):
        find_strays(StatePaths(tmp_path / "never"), time.time())
