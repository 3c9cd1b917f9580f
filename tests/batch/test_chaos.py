"""Short versions of ``make chaos``: clocks, disks, logs and runs that behave badly.

Of cables :mod:`tests.batch.test_cuts` has tests, of stacks those of ``daemon.stacks``.
"""

import pytest

from tests.chaos.bits import bits
from tests.chaos.clock import clock
from tests.chaos.disk import full_disk, may_mount
from tests.chaos.output import MIB, output
from tests.chaos.torn import torn
from tests.chaos.trees import trees


def held(report):
    assert not report.violations, report.text()


def test_what_was_acknowledged_is_there_after_kills_in_commits(tmp_path):
    held(torn(tmp_path, runs=300, kills=1, tears=5))


def test_a_clock_that_is_set_costs_no_lease(tmp_path):
    held(clock(tmp_path, runs=1, steps=1, every=0.6, frozen=False))


@pytest.mark.skipif(not may_mount(), reason="mounting a small file system needs root")
def test_runs_wait_while_the_disk_is_full(tmp_path):
    held(full_disk(tmp_path, runs=4, times=2, hold=0.2))


def test_of_a_tree_of_processes_nothing_is_left(tmp_path):
    held(trees(tmp_path, endings=("cancel",)))


def test_a_bit_that_flips_in_the_log_of_an_idle_daemon_costs_nothing(tmp_path):
    held(bits(tmp_path, campaigns=5, times=1))


def test_runs_that_print_without_end_and_large_results_harm_nobody(tmp_path):
    held(output(tmp_path, chatty=1, chatter=3 * MIB, huge=1, others=1))
