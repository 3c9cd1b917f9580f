"""The daemon is killed while it commits; its write-ahead log loses its end."""

import random
import shutil
import sqlite3
import struct
import time
from contextlib import closing

from daemon.batch.ledger import connect
from tests.chaos.light import Crew
from tests.chaos.report import Report
from tests.chaos.verify import check_book
from tests.make import make_submission
from tests.parts import daemon_at, eventually

CREW = 4


def torn(folder, *, runs=6_000, kills=15, tears=60, seed=1):
    """Kill the daemon in the middle of many commits; what it acknowledged must be there.

    Then tear pages off the end of copies of its write-ahead log: each copy must open to some
    earlier, consistent state.
    """
    report = Report("torn writes: kills during commits, torn write-ahead logs")
    rng = random.Random(seed)
    with daemon_at(folder / "state", 0, lease=2.0, attempts=10_000) as daemon:
        with daemon.client() as client:
            client.submit(make_submission("torn", runs))
        crew = Crew(daemon.endpoint, daemon.state, CREW)
        copies = []
        for kill in range(kills):
            _await_work(crew, runs)
            time.sleep(rng.uniform(0.0, 0.2))
            daemon.kill()
            copies.append(_copy(daemon.state, folder / f"copy-{kill}"))
            _check_acknowledged(report, daemon.state, dict(crew.acknowledged))
            daemon.restart()
        crew.stop()
        report.fact("daemon killed while committing", kills)
        report.fact("results acknowledged", len(crew.acknowledged))
        report.expect(not crew.refused, f"refused: {crew.refused[:2]}")
        daemon.kill()
        _check_acknowledged(report, daemon.state, crew.acknowledged)
        check_book(report, daemon.state / "ledger.db")
    _tear(report, rng, copies, tears, folder / "torn")
    return report


def _await_work(crew, runs):
    """Wait until results come in again, if any are left."""
    wanted = min(len(crew.acknowledged) + 20, runs)
    eventually(lambda: len(crew.acknowledged) >= wanted)


def _check_acknowledged(report, state, acknowledged):
    """The daemon is dead: what it acknowledged must be on the disk."""
    with closing(sqlite3.connect(f"file:{state / 'ledger.db'}?mode=ro", uri=True)) as db:
        kept = dict(db.execute("SELECT run, digest FROM result"))
    missing = [run for run, digest in acknowledged.items() if kept.get(run) != digest]
    report.expect(not missing, f"acknowledged but not there: {missing[:3]} of {len(missing)}")


def _copy(state, target):
    target.mkdir()
    for name in ("ledger.db", "ledger.db-wal", "ledger.db-shm"):
        if (state / name).exists():
            shutil.copyfile(state / name, target / name)
    return target


def _tear(report, rng, copies, tears, at):
    """Open copies whose write-ahead log ends too early or in rubbish, where a power cut can do it.

    That is behind the last commit but one, which was synchronised before the last one began, and
    behind what was to be copied into the database: that is synchronised first.
    """
    lost = 0
    for _ in range(tears):
        shutil.rmtree(at, ignore_errors=True)
        whole = rng.choice(copies)
        shutil.copytree(whole, at)
        journal = at / "ledger.db-wal"
        data = journal.read_bytes() if journal.exists() else b""
        if data:
            kept = _synchronised(data, _checkpointed(at / "ledger.db-shm"))
            end = rng.randrange(kept, len(data) + 1)
            rubbish = rng.randbytes(len(data) - end) if rng.random() < 0.5 else b""
            journal.write_bytes(data[:end] + rubbish)
            lost += len(data) - end
        connect(at / "ledger.db").close()
        check_book(report, at / "ledger.db")
    report.fact("torn write-ahead logs opened", f"{tears}, {lost / 2**20:.1f} MiB torn off")


def _checkpointed(index):
    """How many frames of the log a checkpoint began to copy (sqlite.org/walformat, 2.1)."""
    return struct.unpack_from("=I", index.read_bytes(), 128)[0]


def _synchronised(data, checkpointed):
    """Where the last commit but one ends in a write-ahead log (sqlite.org/fileformat2, 4.1).

    A header of 32 bytes, the page size at 8, the salt at 16; frames of 24 bytes and a page, where
    a commit has a size of the database at 4, and the salt is at 8.
    """
    (page,), salt = struct.unpack(">I", data[8:12]), data[16:24]
    ends = [32, 32]
    for start in range(32, len(data) - page - 23, page + 24):
        if data[start + 8 : start + 16] != salt:
            break
        if data[start + 4 : start + 8] != bytes(4):
            ends.append(start + page + 24)
    return max(ends[-2], 32 + checkpointed * (page + 24))
