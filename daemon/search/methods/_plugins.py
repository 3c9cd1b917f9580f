"""Methods of others, by entry point: used when sound, explained when not.

A plug-in is a function of a task and a space that returns a :class:`SearchMethod`. What it proposes
is checked before it is run, and rounded to the steps of the ranges.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NoReturn

from daemon.model.search import Point, SearchTask
from daemon.search.methods._protocol import MethodProposal
from daemon.search.space import SearchSpace
from grammars.text.diagnostics import Diagnostic, InputError, Where
from grammars.text.plugins import explain_plugin_error, load_plugin, plugin_names

GROUP: Final = "scenario.search_methods"


def plugin_methods() -> tuple[str, ...]:
    """Return the names of the methods of others, without loading any."""
    return plugin_names(GROUP)


def plugin_factory(name: str) -> Callable[[SearchTask, SearchSpace], Any] | None:
    """Return what makes a method of others, ``None`` when there is none of this name.

    Raises ``ValueError`` when it cannot be loaded, or is nothing to call.
    """
    loaded = load_plugin(GROUP, name, "search method")
    if loaded is not None and not callable(loaded):
        kind = type(loaded).__name__
        raise ValueError(f'the search method "{name}" must be a function, not {kind}')
    return loaded


class PluginMethod:
    """A method of others, whose errors say whose they are.

    The scenario as written is proposal 0, where there is one: the plug-in makes those after it.
    Every call raises :class:`InputError` for what goes wrong in it.
    """

    def __init__(self, task: SearchTask, space: SearchSpace) -> None:
        self._task: Final = task
        self._space: Final = space
        factory = plugin_factory(task.method)
        assert factory is not None, "made for a method that was found"
        self._proposals: Final[dict[int, MethodProposal | None]] = {}
        self._method: Final = self._called("does not begin", lambda: factory(task, space))

    def propose(self, number: int) -> MethodProposal | None:
        """Return the scenario as written, then proposals, checked."""
        if number == 0 and self._space.written is not None:
            return MethodProposal(self._space.written, "written", False)
        if number not in self._proposals:
            what = f"does not make proposal {number}"
            made = self._called(what, lambda: self._method.propose(number))
            self._proposals[number] = None if made is None else self._checked(made)
        return self._proposals[number]

    def learn(self, number: int, point: Point, value: float | None) -> None:
        """Hand over what a proposal gave."""
        what = f"does not learn proposal {number}"
        self._called(what, lambda: self._method.learn(number, point, value))

    def best(self) -> int | None:
        """Return the number that it calls the best."""
        best = self._called("does not tell the best", lambda: self._method.best())
        if best is not None and (isinstance(best, bool) or not isinstance(best, int)):
            self._refuse(f"calls {best!r} the best, which is not the number of a proposal")
        return best

    def _called(self, what: str, call: Callable[[], Any]) -> Any:
        try:
            return call()
        except (Exception, SystemExit) as error:
            # Code of other people: it may do anything, leave the program included.
            said = f'the search method "{self._task.method}" {what}'
            self._raise(explain_plugin_error(said, error, __file__), error)

    def _checked(self, made: object) -> MethodProposal:
        if not isinstance(made, MethodProposal) or not isinstance(made.values, tuple):
            must = "a daemon.search.methods.MethodProposal with a tuple of values"
            self._refuse(f"must propose {must}, not {made!r}")
        values, parameters = made.values, self._task.parameters
        if len(values) != len(parameters):
            self._refuse(f"proposes {len(values)} values for {len(parameters)} parameters")
        for axis, value in zip(self._space.axes, values, strict=True):
            if not axis.contains(value):
                self._refuse(f"proposes {value!r} for {axis.parameter.name}, which is outside")
        rounded = self._space.at(self._space.unit(values))
        if not self._space.allowed(rounded):
            self._refuse(f"proposes {rounded}, which the constraints do not allow")
        return MethodProposal(rounded, str(made.method), bool(made.guided))

    def _refuse(self, what: str) -> NoReturn:
        self._raise(f'the search method "{self._task.method}" {what}')

    def _raise(self, message: str, error: BaseException | None = None) -> NoReturn:
        raise InputError(Diagnostic(Where(f'search "{self._task.name}"'), message)) from error
