"""The drawing of the house holds: what import-linter does not check."""

import re
from collections import defaultdict
from graphlib import TopologicalSorter
from pathlib import Path

import grimp
import pytest

import scenario_tui

ROOT = Path(__file__).parents[1]
FLOORS = ("grammars", "templates", "daemon", "scenario_tui")
_FILES = re.compile(r"(?<![\w/.])(?:grammars|templates|daemon|scenario_tui|tests)/[\w./-]*\w")
_CLASS = re.compile(r"^ *class (\w+)[(:]", re.MULTILINE)
_BY_NAME = re.compile(r"""(?:import_module|__import__)\(\s*["'](\w+)""")


@pytest.fixture(scope="module")
def texts():
    """The text of every module of the product, by its path."""
    files = [path for floor in FLOORS for path in sorted((ROOT / floor).rglob("*.py"))]
    return {path.relative_to(ROOT): path.read_text("utf-8") for path in files}


@pytest.fixture(scope="module")
def graph():
    """Which module imports which, wherever in it, for type checkers only as well."""
    return grimp.build_graph(*FLOORS, include_external_packages=True, cache_dir=None)


@pytest.mark.parametrize("name", ["CONTRIBUTING.md", "docs/how-it-works.md"])
def test_files_that_guides_name_are_there(name):
    named = _FILES.findall((ROOT / name).read_text("utf-8"))
    assert len(named) > 3
    assert [file for file in named if not (ROOT / file).exists()] == []


def test_there_is_no_import_circle_of_any_kind(graph, texts):
    ours = {name for name in graph.modules if name.partition(".")[0] in FLOORS}
    assert len(ours) == len(texts) - 1, "all but the plug-in of pytest, which is a module alone"
    imported = {name: graph.find_modules_directly_imported_by(name) & ours for name in ours}
    # The dashboard begins with a screen, and screens name the dashboard for type checkers.
    for name, others in imported.items():
        if name.startswith("scenario_tui.dashboard.screens."):
            others.discard("scenario_tui.dashboard.app")
    TopologicalSorter(imported).prepare()  # else it tells the circle


def test_a_class_name_means_one_thing(texts):
    homes = defaultdict(list)
    for path, text in texts.items():
        for name in _CLASS.findall(text):
            homes[name].append(path)
    shared = {name: places for name, places in homes.items() if len(places) > 1}
    # The public class of a name shows the value of that name.
    public = {"Campaign", "Scene", "Trace"} & set(scenario_tui.__all__)
    assert {name for name, places in shared.items() if len(places) > 2} == set()
    assert set(shared) == public


@pytest.mark.parametrize(
    ("library", "room"), [("sqlite3", "daemon.batch.ledger"), ("mcap", "daemon.trace")]
)
def test_only_the_ledger_speaks_sql_and_only_traces_speak_mcap(graph, texts, library, room):
    speaking = graph.find_modules_that_directly_import(library)
    assert speaking
    assert [name for name in speaking if not name.startswith(room)] == []
    assert [path for path, text in texts.items() if library in _BY_NAME.findall(text)] == []
