"""The WAL of a ledger, read without SQLite, says what SQLite says, and what it does not say."""

import random
import shutil
import sqlite3
import stat
from contextlib import closing

import pytest

from daemon.batch.ledger import LedgerWriter, connect, damaged_copies, read_wal, set_damaged_aside
from daemon.batch.paths import StatePaths
from tests.daemon.batch.samples import make_submission

NOW = 1_700_000_000.0
CAMPAIGNS = 12
HEADER = 32
PAGE = 4096
FRAME = 24 + PAGE


@pytest.fixture
def busy(tmp_path):
    """A ledger that somebody has open, with campaigns that are in its WAL only."""
    path = tmp_path / "busy" / "ledger.db"
    path.parent.mkdir()
    with LedgerWriter.open(StatePaths(path.parent)) as ledger:
        assert ledger.checkpoint()
        for number in range(CAMPAIGNS):
            with ledger.transaction():
                ledger.submit(make_submission(f"c{number}", 1), NOW)
        yield path


def killed(ledger, name="killed"):
    """What is left of a ledger whose daemon was killed now."""
    target = ledger.parent.parent / name
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(ledger.parent, target)
    return target / ledger.name


def flip(path, at):
    data = bytearray(path.read_bytes())
    data[at] ^= 1 << (at % 8)
    path.write_bytes(data)


def wal(ledger):
    return ledger.with_name("ledger.db-wal")


def index(ledger):
    return ledger.with_name("ledger.db-shm")


def campaigns(ledger):
    with closing(sqlite3.connect(ledger)) as db:
        return int(db.execute("SELECT count(*) FROM campaign").fetchone()[0])


def test_a_wal_is_sound_while_it_is_written_and_after_a_kill(busy):
    here, left = read_wal(busy), read_wal(killed(busy))
    assert here == left
    assert (here.damaged, here.lost, here.checkpointed) == (False, 0, 0)
    assert here.size == HEADER + here.sound * FRAME
    assert campaigns(killed(busy)) == CAMPAIGNS


@pytest.mark.parametrize("with_index", [True, False])
def test_a_wrong_bit_is_noticed_exactly_when_sqlite_loses_something(busy, with_index):
    chance = random.Random(5)
    size = wal(busy).stat().st_size
    # Without the index nobody can tell whether the last transaction was torn or acknowledged.
    last = size if with_index else size - 12 * FRAME
    for _ in range(12):
        left = killed(busy)
        if not with_index:
            index(left).unlink()
        flip(wal(left), chance.randrange(last))
        found = read_wal(left)
        try:
            lost = CAMPAIGNS - campaigns(left)
        except sqlite3.Error:
            lost = CAMPAIGNS
        assert found.damaged == (lost > 0)
        assert found.lost == 0 or lost <= found.lost + 1


def test_what_was_never_committed_is_not_lost(busy):
    torn = killed(busy)
    with wal(torn).open("ab") as file:
        file.write(wal(torn).read_bytes()[HEADER : HEADER + FRAME // 2])
    assert not read_wal(torn).damaged
    with LedgerWriter.open(StatePaths(busy.parent)) as other, closing(connect(busy)) as reading:
        reading.execute("BEGIN")
        reading.execute("SELECT count(*) FROM run").fetchone()
        assert other.checkpoint() is False  # somebody reads an older state: nobody waits for that
    copied = killed(busy)
    assert read_wal(copied).checkpointed == read_wal(copied).committed
    flip(wal(copied), HEADER + 3 * FRAME + 100)
    assert (read_wal(copied).damaged, read_wal(copied).lost) == (True, 0)


def test_no_wal_is_fine_unless_something_was_only_there(busy, tmp_path):
    assert read_wal(tmp_path / "none" / "ledger.db").size == 0
    left = killed(busy)
    wal(left).unlink()
    assert read_wal(left).lost
    index(left).unlink()
    assert not read_wal(left).damaged


def test_a_damaged_wal_is_put_aside_before_sqlite_drops_what_is_behind(busy):
    left = killed(busy)
    flip(wal(left), HEADER + read_wal(busy).sound // 2 * FRAME + 500)
    before = wal(left).read_bytes()
    found, copy = set_damaged_aside(left, NOW)
    assert found.lost > 0
    assert copy is not None
    assert copy.name == "ledger.db-wal.damaged-20231114T221320Z"
    assert copy.read_bytes() == before
    assert stat.S_IMODE(copy.stat().st_mode) == 0o600
    assert damaged_copies(left) == (copy,)
    assert 0 < campaigns(left) < CAMPAIGNS
    assert set_damaged_aside(left, NOW) == (read_wal(left), None)


def test_old_pages_of_a_damaged_wal_do_not_cover_newer_ones_of_the_ledger(busy):
    with (
        LedgerWriter.open(StatePaths(busy.parent)) as ledger,
        closing(connect(busy)) as reading,
    ):
        reading.execute("BEGIN")
        reading.execute("SELECT count(*) FROM run").fetchone()
        ledger.checkpoint()  # copied, and not emptied: somebody reads
        left = killed(busy)
    flip(wal(left), HEADER + read_wal(left).sound // 2 * FRAME + 500)
    found, copy = set_damaged_aside(left, NOW)
    assert (found.damaged, found.lost) == (True, 0)
    assert copy is not None
    assert not wal(left).exists()
    assert campaigns(left) == CAMPAIGNS
    with closing(sqlite3.connect(left)) as db:
        assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)
