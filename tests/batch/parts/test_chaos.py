"""Short versions of ``make chaos``, of what no other test holds: commits and bits that are torn."""

from tests.chaos.bits import bits
from tests.chaos.torn import torn


def test_what_was_acknowledged_is_there_after_kills_in_commits(tmp_path):
    report = torn(tmp_path, runs=300, kills=1, tears=5)
    assert not report.violations, report.text()


def test_a_bit_that_flips_in_the_log_of_an_idle_daemon_costs_nothing(tmp_path):
    report = bits(tmp_path, campaigns=5, times=1)
    assert not report.violations, report.text()
