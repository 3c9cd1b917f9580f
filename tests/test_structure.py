"""The drawing of the house holds: what import-linter does not check."""

import re
from pathlib import Path

import pytest

import scenario_tui
from tests.structure import Module, circles, class_homes, import_graph, read_modules

ROOT = Path(__file__).parents[1]
_FILES = re.compile(r"(?<![\w/.])(?:grammars|templates|daemon|scenario_tui|tests)/[\w./-]*\w")


@pytest.fixture(scope="module")
def modules():
    return read_modules(ROOT)


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "docs/how-it-works.md"])
def test_files_that_guides_name_are_there(name):
    named = _FILES.findall((ROOT / name).read_text("utf-8"))
    assert len(named) > 3
    assert [file for file in named if not (ROOT / file).exists()] == []


def test_there_is_no_import_circle_of_any_kind(modules):
    graph = import_graph(modules)
    # The dashboard begins with a screen, and screens name the dashboard for type checkers.
    for name, imported in graph.items():
        if name.startswith("scenario_tui.dashboard.screens."):
            imported.discard("scenario_tui.dashboard.app")
    assert circles(graph) == []


def test_a_class_name_means_one_thing(modules):
    shared = {name: homes for name, homes in class_homes(modules).items() if len(homes) > 1}
    # The public class of a name shows the value of that name.
    public = {"Campaign", "Scene", "Trace"} & set(scenario_tui.__all__)
    assert {name for name, homes in shared.items() if len(homes) > 2} == set()
    assert set(shared) == public


def test_circles_are_found():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}, "e": set[str]()}
    assert circles(graph) == [["a", "b", "c"]]


def test_only_the_ledger_speaks_sql_and_only_traces_speak_mcap(modules):
    """The library of each is imported in its room alone."""
    speaking = {
        library: sorted(
            module.name
            for module in modules
            if not module.name.startswith(rooms) and library in module.libraries()
        )
        for library, rooms in {
            "sqlite3": ("daemon.batch.ledger",),
            "mcap": ("daemon.trace",),
        }.items()
    }
    assert speaking == {"sqlite3": [], "mcap": []}


@pytest.mark.parametrize(
    ("text", "libraries"),
    [
        ('"""What comes from mcap, by import sqlite3."""\n', set()),
        ("def read():\n    import sqlite3.dbapi2\n", {"sqlite3"}),
        ("from mcap.reader import make_reader\n", {"mcap"}),
        (
            'import importlib\nread = importlib.import_module("mcap.reader")\n',
            {"importlib", "mcap"},
        ),
        ("from ._reader import mcap\n", set()),
    ],
)
def test_libraries_are_what_is_imported_not_what_is_spoken_of(tmp_path, text, libraries):
    (tmp_path / "room.py").write_text(text)
    assert Module(tmp_path / "room.py", tmp_path).libraries() == libraries
