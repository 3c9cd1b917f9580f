"""Where submissions are judged, a test that is skipped has failed unless ``may_skip.txt`` names it.

A green suite says nothing of tests that were skipped in silence: reference data that is not there,
a library that was not installed.
"""

import os
import re
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

LIST = Path(__file__).with_name("may_skip.txt")


def listed():
    """Patterns of tests that may be skipped, and the words with which."""
    lines = LIST.read_text("utf-8").splitlines()
    return [tuple(re.split(r"\s{2,}", line)) for line in lines if line and line[0] != "#"]


def judged(report):
    """Return the report of a test or a file, failed when it must not have been skipped."""
    expected = hasattr(report, "wasxfail")
    if "CI" not in os.environ or not report.skipped or expected:
        return report
    said = str(report.longrepr[2])
    if not any(fnmatchcase(report.nodeid, test) and words in said for test, words in listed()):
        report.outcome = "failed"
        report.longrepr = (
            f"{report.nodeid} was skipped, and tests/may_skip.txt does not say: {said}"
        )
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    return judged((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report():
    return judged((yield))
