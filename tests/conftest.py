"""Fixtures every room's tests may use."""

from __future__ import annotations

import gc
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# A round of all tests looks at fewer examples than hypothesis would by itself, and each round on a
# developer's machine at others; "--hypothesis-profile thorough" looks at many.
# Loading compiled kernels for the first time takes longer than hypothesis allows one example, and
# beside other load so does making examples. What lands is judged by the same examples each time;
# new ones are sought on developers' machines.
settings.register_profile(
    "project",
    max_examples=25,
    deadline=None,
    derandomize="CI" in os.environ,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("thorough", settings.get_profile("project"), max_examples=300)
settings.load_profile("project")

# A test process holds some hundred megabytes of modules, compiled code and collected tests. With
# Python's thresholds a fifth of the time of tests of the dashboard went into walking through them.
gc.set_threshold(20_000, 20, 50)


# Processes take whole files, as long as there are some. In these folders tests start daemons,
# workers and commands, and wait for them most of the time; a test takes about so many seconds
# there, and elsewhere OTHERWISE.
WAITING = {
    "daemon/batch": 1.5,
    "daemon/supervision": 1.0,
    "daemon/stacks/ros2": 0.2,
    "scenario_tui/cli": 0.8,
}
OTHERWISE = 0.2


def pytest_configure(config: pytest.Config) -> None:
    """Hand out files in the order below, and not those of the most tests first."""
    config.option.loadscopereorder = False


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """For several processes: let files that wait run beside files that compute, long ones first.

    Files of few long tests would otherwise come last, at once, with idle processors.
    """
    if not hasattr(config, "workerinput"):
        return
    # What waits and what computes, each with the seconds of every file.
    kinds: tuple[dict[Path, float], dict[Path, float]] = ({}, {})
    for item in items:
        folder = item.path.parent.relative_to(Path(__file__).parent).as_posix()
        seconds = next((s for start, s in WAITING.items() if folder.startswith(start)), None)
        files = kinds[seconds is None]
        files[item.path] = files.get(item.path, 0.0) + (seconds or OTHERWISE)
    place: dict[Path, float] = {}
    for files in kinds:
        done, total = 0.0, sum(files.values())
        for path in sorted(files, key=lambda path: (-files[path], path)):
            place[path] = done / total
            done += files[path]
    items.sort(key=lambda item: (place[item.path], item.path))


def pytest_collection_finish() -> None:
    """Leave what lives until the end out of every later garbage collection."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def reference_data() -> Path:
    """The folder of published inputs and measured results; tests that need it skip without."""
    folder = os.environ.get("SCENARIO_REFERENCE_DATA")
    if not folder:
        pytest.skip("SCENARIO_REFERENCE_DATA names no folder of reference data")
    return Path(folder)


@pytest.fixture(scope="session")
def campaigns() -> Path:
    """The folder of campaigns that ship with the project."""
    return Path(__file__).parent.parent / "campaigns"
