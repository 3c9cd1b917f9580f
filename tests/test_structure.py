"""The drawing of the house holds: what import-linter does not check."""

import re
from pathlib import Path

import pytest

from tests.structure import circles, class_homes, import_graph, read_modules

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
    assert circles(import_graph(modules)) == []


def test_a_class_name_means_one_thing(modules):
    assert {name: homes for name, homes in class_homes(modules).items() if len(homes) > 1} == {}


def test_circles_are_found():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}, "e": set[str]()}
    assert circles(graph) == [["a", "b", "c"]]


def test_only_the_ledger_speaks_sql_and_only_traces_speak_mcap(modules):
    """The library of each is imported in its room alone; elsewhere for no more than its errors."""
    speaking = {
        library: sorted(
            module.name
            for module in modules
            if not module.name.startswith(rooms)
            and any(f"{word} {library}" in module.text for word in ("import", "from"))
        )
        for library, rooms in {
            "sqlite3": ("daemon.batch.ledger",),
            "mcap": ("daemon.trace",),
        }.items()
    }
    assert speaking == {"sqlite3": [], "mcap": []}
