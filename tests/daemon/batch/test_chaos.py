"""Short versions of ``make chaos``: clocks, disks, logs and runs that behave badly.

Of cables :mod:`tests.daemon.batch.test_cuts` has tests, of stacks those of ``daemon.stacks``.
"""

import pytest

from daemon.batch.ledger import LedgerWriter, connect
from daemon.batch.server import DaemonClock
from tests.chaos.bits import bits
from tests.chaos.clock import clock
from tests.chaos.disk import full_disk, may_mount
from tests.chaos.output import MIB, output
from tests.chaos.torn import torn
from tests.chaos.trees import trees
from tests.daemon.batch.samples import make_submission

HOUR = 3600.0


def held(report):
    assert not report.violations, report.text()


def test_what_was_acknowledged_is_there_after_kills_in_commits(tmp_path):
    held(torn(tmp_path, runs=300, kills=1, tears=5))


def test_a_clock_that_is_set_costs_no_lease(tmp_path):
    held(clock(tmp_path, runs=1, steps=1, every=0.6, frozen=False))


@pytest.mark.skipif(not may_mount(), reason="mounting a small file system needs root")
def test_runs_wait_while_the_disk_is_full(tmp_path):
    held(full_disk(tmp_path, runs=2, times=1, hold=0.2))


def test_of_a_tree_of_processes_nothing_is_left(tmp_path):
    held(trees(tmp_path, endings=("cancel",)))


def test_a_bit_that_flips_in_the_log_of_an_idle_daemon_costs_nothing(tmp_path):
    held(bits(tmp_path, campaigns=5, times=1))


def test_runs_that_print_without_end_and_large_results_harm_nobody(tmp_path):
    held(output(tmp_path, chatty=1, chatter=3 * MIB, huge=1, others=1))


class Hand:
    """A clock with hands: ``wall`` can be set, ``steady`` only goes on."""

    def __init__(self):
        self.wall = 1_000_000.0
        self.steady = 5.0

    def pass_by(self, seconds):
        self.wall += seconds
        self.steady += seconds


@pytest.mark.parametrize("step", [-24 * HOUR, -HOUR, 2.0, HOUR, 24 * HOUR])
def test_leases_last_as_long_as_they_are_whatever_the_clock_says(tmp_path, step):
    hand = Hand()
    clock = DaemonClock(lambda: hand.wall, lambda: hand.steady)
    db = connect(tmp_path / "ledger.db")
    book = LedgerWriter(db, lease=30.0)
    book.submit(make_submission("c", 2), clock.now())
    book.lease("w", 2, clock.now())
    hand.pass_by(20.0)
    hand.wall += step
    assert book.expire_leases(clock.now()) == 0
    book.shift_leases(clock.follow_wall_clock())
    assert clock.now() == pytest.approx(hand.wall)
    assert book.expire_leases(clock.now()) == 0
    hand.pass_by(9.9)
    assert clock.follow_wall_clock() == 0.0
    assert book.expire_leases(clock.now()) == 0
    hand.pass_by(0.2)
    assert book.expire_leases(clock.now()) == 2
    db.close()


def test_a_daemon_that_starts_on_an_earlier_clock_keeps_no_lease_for_longer(tmp_path):
    db = connect(tmp_path / "ledger.db")
    LedgerWriter(db).submit(make_submission("c", 1), 10 * HOUR)
    LedgerWriter(db).lease("w", 1, 10 * HOUR)
    book = LedgerWriter(db, lease=30.0)
    assert book.extend_leases(HOUR) == 1
    assert book.expire_leases(HOUR + 31.0) == 1
    db.close()
