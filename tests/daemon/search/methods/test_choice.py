"""Which methods there are: those of others too, and why one cannot be used."""

import importlib.util
import re
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from daemon.search.methods import (
    METHODS,
    MethodProposal,
    make_method,
    method_names,
    method_problem,
)
from daemon.search.space import SearchSpace
from grammars.text import plugins
from grammars.text.diagnostics import InputError
from tests.daemon.search.spaces import chosen, ranged, search_task, searched

PAGE = Path(__file__).parents[4] / "docs" / "search.md"
MODULE = """
from daemon.search.methods import MethodProposal

class Sweep:
    def __init__(self, task, space, values=(0.1234, 4.0)):
        self.values, self.learnt = values, []
    def propose(self, number):
        return MethodProposal(self.values, "sweep", False)
    def learn(self, number, point, value):
        self.learnt.append((number, point, value))
    def best(self):
        return self.learnt[0][0] if self.learnt else None

class Broken(Sweep):
    def propose(self, number):
        raise KeyError("no such thing")
    def learn(self, number, point, value):
        exit(1)
    def best(self):
        return "the first"

class Ended(Sweep):
    def propose(self, number):
        return None

class Bare(Sweep):
    def propose(self, number):
        return (1.0, 2.0)

sweep, broken, ended, bare = Sweep, Broken, Ended, Bare
short = lambda task, space: Sweep(task, space, (1.0,))
outside = lambda task, space: Sweep(task, space, (11.0, 1.0))
wordy = lambda task, space: Sweep(task, space, ("high", 1.0))
refused = lambda task, space: Sweep(task, space, (9.0, 1.0))
def stillborn(task, space):
    raise RuntimeError("out of luck")
number = 42
"""
NAMES = ("sweep", "broken", "ended", "bare", "short", "outside", "wordy", "refused", "stillborn")


@pytest.fixture
def _plugged(tmp_path, monkeypatch):
    (tmp_path / "their_methods.py").write_text(MODULE)
    (example,) = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    (tmp_path / "their_documentation.py").write_text(example)
    (tmp_path / "their_imports.py").write_text("import a_module_nobody_has\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    objects = {name: f"their_methods:{name}" for name in (*NAMES, "number")} | {
        "one-at-a-time": "their_documentation:OneAtATime",
        "imports": "their_imports:method",
        "halton": "their_methods:broken",
    }
    group = "scenario.search_methods"
    entries = {group: {name: EntryPoint(name, value, group) for name, value in objects.items()}}
    plugins.load_plugin.cache_clear()
    monkeypatch.setattr(plugins, "installed", entries.__getitem__)
    yield
    plugins.load_plugin.cache_clear()
    for module in ("their_methods", "their_imports", "their_documentation"):
        sys.modules.pop(module, None)


def task_of(method):
    return search_task(ranged(), ranged("b"), method=method, constraints=("a < b + 5 s",))


def refusal(method, numbers=2):
    task = task_of(method)
    with pytest.raises(InputError) as refused:
        searched(task, lambda _: 0.0, numbers)
    assert refused.value.diagnostics[0].where.file == 'search "s"'
    return refused.value.diagnostics[0].message


@pytest.mark.usefixtures("_plugged")
def test_a_method_of_others_proposes_after_the_scenario_as_written():
    done = [proposal for proposal, _ in searched(task_of("sweep"), lambda _: 0.0, 2)]
    assert done == [
        MethodProposal((5.0, 5.0), "written", False),
        MethodProposal((0.12, 4.0), "sweep", False),  # rounded to the step
    ]


@pytest.mark.usefixtures("_plugged")
def test_a_method_of_others_learns_and_tells_the_best():
    task = task_of("sweep")
    made = make_method(task, SearchSpace(task))
    assert made.best() is None
    made.learn(0, (5.0, 5.0), 0.5)
    assert made.best() == 0


@pytest.mark.usefixtures("_plugged")
def test_a_method_of_others_may_end_the_search():
    assert len(searched(task_of("ended"), lambda _: 0.0, 5)) == 1


@pytest.mark.usefixtures("_plugged")
def test_the_method_of_the_documentation_does_what_is_said_there():
    done = [p.values for p, _ in searched(task_of("one-at-a-time"), lambda _: 0.0, 5)]
    assert len(done) == 5
    assert all((a == 5.0) != (b == 5.0) for a, b in done[1:])


@pytest.mark.usefixtures("_plugged")
@pytest.mark.parametrize(
    ("method", "words"),
    [
        ("broken", 'the search method "broken" does not make proposal 1: KeyError'),
        ("stillborn", 'the search method "stillborn" does not begin: RuntimeError: out of luck'),
        ("bare", "must propose a daemon.search.methods.MethodProposal"),
        ("short", "proposes 1 values for 2 parameters"),
        ("outside", "proposes 11.0 for a, which is outside"),
        ("wordy", "proposes 'high' for a, which is outside"),
        ("refused", "which the constraints do not allow"),
        ("imports", 'the search method "imports" (their_imports:method) cannot be loaded'),
        ("number", 'the search method "number" must be a function, not int'),
    ],
)
def test_what_goes_wrong_in_a_method_of_others_is_told(method, words):
    assert words in refusal(method)


@pytest.mark.usefixtures("_plugged")
def test_the_line_of_others_is_told():
    assert re.search(r"their_methods\.py:\d+\)", refusal("broken"))


@pytest.mark.usefixtures("_plugged")
def test_a_method_of_others_cannot_end_the_program():
    task = task_of("broken")
    made = make_method(task, SearchSpace(task))
    with pytest.raises(InputError, match="does not learn proposal 0: SystemExit"):
        made.learn(0, (5.0, 5.0), 0.5)
    with pytest.raises(InputError, match="calls 'the first' the best"):
        made.best()


@pytest.mark.usefixtures("_plugged")
def test_methods_that_ship_are_not_replaced():
    assert method_names()[: len(METHODS)] == METHODS
    assert method_names().count("halton") == 1
    assert "sweep" in method_names()
    assert len(searched(task_of("halton"), lambda _: 0.0, 3)) == 3


def test_an_unknown_method_is_told_with_what_was_meant():
    assert method_problem(task_of("halten")) == (
        'there is no method "halten"; did you mean "halton"?'
    )


@pytest.mark.parametrize("method", METHODS)
def test_the_methods_that_ship_can_be_used(method):
    assert method_problem(task_of(method)) == ""


@pytest.mark.parametrize(
    ("task", "words"),
    [
        (search_task(ranged(), chosen("b", "x", "y"), method="cma"), "b is a list"),
        (search_task(ranged(), method="cma"), "takes two parameters or more"),
    ],
)
def test_what_adaptation_cannot_vary_is_told(task, words):
    assert words in method_problem(task)


@pytest.fixture
def without_libraries(monkeypatch):
    find = importlib.util.find_spec
    missing = ("optuna", "cmaes")
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name in missing else find(name)
    )


@pytest.mark.usefixtures("without_libraries")
def test_what_installs_a_missing_library_is_told_and_what_works_without():
    for method, library in (("auto", "optuna"), ("tpe", "optuna"), ("cma", "cmaes")):
        assert method_problem(task_of(method)) == (
            f"the method {method} takes the library {library}, which is not installed; install it "
            'with: pip install "scenario-tui[search]", or write method: halton, '
            "which works without"
        )
    for method in ("halton", "random", "boundary"):
        assert method_problem(task_of(method)) == ""


@pytest.mark.usefixtures("without_libraries")
def test_a_short_search_needs_no_library():
    assert method_problem(search_task(ranged(), method="auto", runs=16)) == ""
    assert "optuna" in method_problem(search_task(ranged(), method="auto", runs=17))


def test_even_and_random_searches_import_no_library():
    code = (
        "import sys\n"
        "from tests.daemon.search.spaces import ranged, search_task, searched\n"
        "for method in ('halton', 'random', 'boundary'):\n"
        "    searched(search_task(ranged(), method=method), lambda p: p[0] - 3.0, 30)\n"
        "assert not {'optuna', 'cmaes', 'scipy'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
