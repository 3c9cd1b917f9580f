"""One campaign recorded and one page written, looked at by many tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from daemon.protocol import Submission
from daemon.report import Command, Material, folder_of_traces, gather, leave_note, write_page
from tests.daemon.oracles.traces import CORRIDOR
from tests.daemon.report.recordings import ABOUT, DECLARED, NAME, record_all

COMMAND = Command("scenario judge {run}", "judge it again")


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as `scenario run` leaves it."""
    made = tmp_path_factory.mktemp("results")
    specs = record_all(made)
    leave_note(made, Submission("c", NAME, ABOUT, "", specs, (CORRIDOR,), declared=DECLARED))
    return made


@pytest.fixture(scope="session")
def material(folder: Path) -> Material:
    return gather(folder_of_traces(folder), processes=1)


@pytest.fixture(scope="session")
def page(material: Material) -> str:
    return write_page(material, (COMMAND,), processes=1)
