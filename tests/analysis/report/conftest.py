"""One campaign recorded and one page written, looked at by many tests."""

import pytest

from daemon.analysis.report import write_page
from tests.analysis.report.recordings import commands, record_campaign, report_of


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A folder as `scenario run` leaves it."""
    return record_campaign(tmp_path_factory.mktemp("traces") / "results")


@pytest.fixture(scope="session")
def data(folder):
    return report_of(folder)


@pytest.fixture(scope="session")
def page(data):
    return write_page(data, commands, processes=1)
