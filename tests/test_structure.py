"""The drawing of the house holds: what import-linter does not check."""

import ast
import re
from collections import defaultdict
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import scenario_tui

ROOT = Path(__file__).parents[1]
_FILES = re.compile(r"(?<![\w/.])(?:grammars|templates|daemon|scenario_tui|tests)/[\w./-]*\w")


FLOORS = ("grammars", "templates", "daemon", "scenario_tui")


class Module:
    """One file: its name, and what it imports, calls and defines."""

    def __init__(self, path, top):
        parts = path.relative_to(top).with_suffix("").parts
        self.name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        tree = ast.parse(path.read_text(encoding="utf-8"))
        telling = ast.Import | ast.ImportFrom | ast.Call | ast.ClassDef
        self.nodes = [node for node in ast.walk(tree) if isinstance(node, telling)]

    def libraries(self):
        """Top names of everything that is imported anywhere, also by ``import_module``."""
        found = set()
        for node in self.nodes:
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                found.add(node.module)
            elif isinstance(node, ast.Call) and _called(node) in ("import_module", "__import__"):
                found |= {arg.value for arg in node.args if isinstance(arg, ast.Constant)}
        return {str(name).partition(".")[0] for name in found}

    def imports(self, known):
        """Modules of ours that this one imports anywhere, for type checkers only as well."""
        found = set()
        for node in self.nodes:
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    inner = f"{node.module}.{alias.name}"
                    found.add(inner if inner in known else node.module)
        return (found & known) - {self.name}


def _called(call):
    """Return the last part of the name of what is called."""
    function = call.func
    return getattr(function, "attr", "") or getattr(function, "id", "")


def read_modules(top):
    """All modules of the product in a checkout, packages included."""
    return [Module(p, top) for floor in FLOORS for p in sorted((top / floor).rglob("*.py"))]


def import_graph(modules):
    """Which module of ours imports which, wherever in it the import stands."""
    known = {module.name for module in modules}
    return {module.name: module.imports(known) for module in modules}


def class_homes(modules):
    """The modules that define a class of each name."""
    homes = defaultdict(list)
    for module in modules:
        for node in module.nodes:
            if isinstance(node, ast.ClassDef):
                homes[node.name].append(module.name)
    return dict(homes)


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
    TopologicalSorter(graph).prepare()  # else it tells the circle


def test_a_class_name_means_one_thing(modules):
    shared = {name: homes for name, homes in class_homes(modules).items() if len(homes) > 1}
    # The public class of a name shows the value of that name.
    public = {"Campaign", "Scene", "Trace"} & set(scenario_tui.__all__)
    assert {name for name, homes in shared.items() if len(homes) > 2} == set()
    assert set(shared) == public


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
