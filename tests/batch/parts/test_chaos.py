"""Short versions of ``make chaos``, of what no other test holds: commits that are torn."""

from tests.chaos.torn import torn


def test_what_was_acknowledged_is_there_after_kills_in_commits(tmp_path):
    report = torn(tmp_path, runs=300, kills=1, tears=5)
    assert not report.violations, report.text()
