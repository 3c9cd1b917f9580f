"""Which methods there are, and why one cannot be used."""

import importlib.util
import subprocess
import sys

import pytest

from daemon.search.methods import METHODS, method_problem
from tests.daemon.search.spaces import chosen, ranged, search_task


def task_of(method):
    return search_task(ranged(), ranged("b"), method=method, constraints=("a < b + 5 s",))


def test_an_unknown_method_is_told_with_what_was_meant():
    assert str(method_problem(task_of("halten"))) == (
        'there is no method "halten"; did you mean "halton"?'
    )


@pytest.mark.parametrize("method", METHODS)
def test_the_methods_that_ship_can_be_used(method):
    assert method_problem(task_of(method)) is None


@pytest.mark.parametrize(
    ("task", "words"),
    [
        (search_task(ranged(), chosen("b", "x", "y"), method="cma"), "b is a list"),
        (search_task(ranged(), method="cma"), "takes two parameters or more"),
    ],
)
def test_what_adaptation_cannot_vary_is_told(task, words):
    assert words in str(method_problem(task))


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
        assert str(method_problem(task_of(method))) == (
            f"the method {method} takes the library {library}, which is not installed; install it "
            'with: pip install "scenario-tui[search]", or write method: halton, '
            "which works without"
        )
    for method in ("halton", "random", "boundary"):
        assert method_problem(task_of(method)) is None


@pytest.mark.usefixtures("without_libraries")
def test_a_short_search_needs_no_library():
    assert method_problem(search_task(ranged(), method="auto", runs=16)) is None
    assert "optuna" in str(method_problem(search_task(ranged(), method="auto", runs=17)))


def test_even_and_random_searches_import_no_library_of_a_method():
    code = (
        "import sys\n"
        "from tests.daemon.search.spaces import ranged, search_task, searched\n"
        "for method in ('halton', 'random', 'boundary'):\n"
        "    searched(search_task(ranged(), method=method), lambda p: p[0] - 3.0, 30)\n"
        "assert not {'optuna', 'cmaes'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
