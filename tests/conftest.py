"""Fixtures every room's tests may use."""

import difflib
import functools
import gc
import json
import os
import shutil
import sys
from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, settings

from grammars.text.parsing import Language
from tests.may_skip import pytest_make_collect_report, pytest_runtest_makereport
from tests.rings import order_by_ring

__all__ = ["pytest_make_collect_report", "pytest_runtest_makereport"]

# A round of all tests looks at fewer examples than hypothesis would by itself, and each round on a
# developer's machine at others; `make thorough` looks at many.
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
settings.register_profile("thorough", settings.get_profile("project"), max_examples=500)
settings.load_profile("project")

# Children start by the hundred. Where Python may not write bytecode, as in some containers, each of
# them compiles the project again, and each process of pytest the tests.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# A test process holds some hundred megabytes of modules, compiled code and collected tests. With
# Python's thresholds a fifth of the time of tests of the dashboard went into walking through them.
gc.set_threshold(20_000, 20, 50)


def pytest_addoption(parser):
    parser.addoption("--update", action="store_true", help="write golden files anew; review them")


def pytest_collection_modifyitems(items):
    order_by_ring(items)


def pytest_collection_finish():
    """Leave what lives until the end out of every later garbage collection."""
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol():
    """Leave out of later collections too what a test leaves that collected all there was.

    Each run does, and kernels and what they are loaded with are hundreds of thousands of objects.
    """
    before = gc.get_stats()[2]["collections"]
    done = yield
    if gc.get_stats()[2]["collections"] > before:
        gc.collect()
        gc.freeze()
    return done


def pytest_sessionfinish():
    """Look for what was left open once: pytest does five times, through all there is."""
    gc.collect()
    gc.freeze()


_read_once = functools.lru_cache(maxsize=256)(Language._tree)


@pytest.fixture(scope="session", autouse=True)
def _texts_are_read_once():
    """Read the same text of a language once.

    Nobody changes a tree, and reading the campaigns that ship again and again took two fifths of
    the time of the tests that load them.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Language, "_tree", lambda language, text: _read_once(language, text))
        yield


@pytest.fixture(scope="session")
def reference_data():
    """The folder of published inputs and measured results; tests that need it skip without."""
    folder = os.environ.get("SCENARIO_REFERENCE_DATA")
    if not folder:
        pytest.skip("SCENARIO_REFERENCE_DATA names no folder of reference data")
    return Path(folder)


@pytest.fixture(scope="session")
def campaigns():
    """The folder of campaigns that ship with the project."""
    return Path(__file__).parent.parent / "campaigns"


SMALL_CAMPAIGN = {
    "campaign": "tiny",
    "seed": 3,
    "limit": "30 s",
    "robot": "courier",
    "oracles": "navigation",
    "matrix": {"sut": ["pilot"]},
    "scenarios": {
        "calm": {
            "floorplan": "flat",
            "objects": "doors",
            "behaviours": "doors_open",
            "mission": "courier",
            "oracles": ["reached"],
        }
    },
}


@pytest.fixture
def demo(tmp_path, campaigns):
    """A copy of the demonstration's folder; the robots and systems that ship are found anyway."""
    return Path(shutil.copytree(campaigns / "demo", tmp_path / "demo"))


@pytest.fixture
def campaign(demo):
    """Write a small campaign beside the layers of the demonstration: ``campaign(repeats=2)``.

    The campaign has one scenario, ``calm``. Each key replaces a key of the campaign, None removes
    one; ``scenarios`` come after ``calm``, or replace it by its name. The result is the path.
    """

    def write(**changes):
        scenarios = SMALL_CAMPAIGN["scenarios"] | (changes.get("scenarios") or {})
        content = SMALL_CAMPAIGN | changes | {"scenarios": _without_none(scenarios)}
        path = demo / "campaign.yaml"
        plain = json.loads(json.dumps(_without_none(content)))  # twice the same is no alias
        path.write_text(yaml.safe_dump(plain, sort_keys=False), "utf-8")
        return path

    return write


def _without_none(values):
    return {key: value for key, value in values.items() if value is not None}


@pytest.fixture
def golden(request):
    """Compare a text with the golden file of that name beside the test: ``golden(name, text)``.

    ``pytest --update`` writes what differs.
    """

    def compare(name, text):
        path = request.path.parent / name
        expected = path.read_text("utf-8") if path.exists() else ""
        if text == expected:
            return
        if request.config.getoption("--update"):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, "utf-8")
            return
        lines = difflib.unified_diff(
            expected.splitlines(), text.splitlines(), name, "today", n=3, lineterm=""
        )
        pytest.fail("\n".join([*lines, "To keep what is new: pytest --update"]), pytrace=False)

    return compare


@pytest.fixture
def daemon(tmp_path):
    """A real daemon on loopback for one test, without workers of its own."""
    # Imported here: parts are forked where the environment is that of this import, and plug-ins
    # of pytest still change it when this file is read.
    from tests.parts import daemon_at

    with daemon_at(tmp_path / "state") as part:
        yield part
