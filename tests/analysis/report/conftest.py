"""One campaign recorded and one page written, looked at by many tests."""

from dataclasses import replace

import pytest

from daemon.analysis.report import SuggestedCommand, write_page
from daemon.analysis.results import write_campaign_note
from daemon.model.submission import Submission
from tests.analysis.report.recordings import ABOUT, DECLARED, NAME, record_all, report_of
from tests.engine.judging.traces import CORRIDOR

COMMAND = SuggestedCommand("scenario judge {run}", "judge it again")


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A folder as `scenario run` leaves it."""
    made = tmp_path_factory.mktemp("results")
    specs = record_all(made)
    plain = Submission.of("c", specs, (CORRIDOR,))
    write_campaign_note(made, replace(plain, name=NAME, about=ABOUT, declared=DECLARED))
    return made


@pytest.fixture(scope="session")
def data(folder):
    return report_of(folder)


@pytest.fixture(scope="session")
def page(data):
    return write_page(data, (COMMAND,), processes=1)
