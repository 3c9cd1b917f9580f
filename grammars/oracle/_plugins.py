"""Signals and oracles of one's own: Python objects that packages name as entry points.

The entry point's name is the signal's or the oracle's, as it is written in oracle lines; its object
is a :class:`CustomSignal` (group ``scenario.signals``) or a :class:`CustomOracle` (group
``scenario.oracles``). Names that ship here are never replaced.

They are the code of other people: nothing is loaded before a line names it, and whatever goes wrong
in it becomes a message.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from grammars.oracle._dimension import Dimension, dimension
from grammars.plugins import explain, origin
from grammars.quantity import read_quantity

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

SIGNAL_GROUP: Final = "scenario.signals"
ORACLE_GROUP: Final = "scenario.oracles"
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*(\.[A-Za-z0-9_][A-Za-z0-9_-]*)*")


@dataclass(frozen=True, slots=True)
class CustomSignal:
    """A signal of one's own.

    ``sample(trace, time, *arguments)`` takes a :class:`daemon.trace.Trace` (read-only), the time
    base (n,) [s] and the SI values of its arguments, and returns the signal at those times: (n,)
    numbers in ``unit``, NaN where it is not known. A value at a time must not depend on what is
    recorded later, or verdicts on a run that is still going may contradict the final ones.

    ``unit`` is an SI unit such as ``m/s``, ``1`` for a plain number, or ``bool``; ``arguments`` are
    the units of its arguments.
    """

    sample: Callable[..., Any]
    unit: str
    doc: str = ""
    arguments: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class CustomOracle:
    """An oracle of one's own, for what the language cannot say.

    ``judge(trace, *arguments)`` takes a :class:`daemon.trace.Trace` (read-only) and the SI values
    of its arguments, and returns the interval of the signed margin ``(lower, upper)`` in ``unit``,
    or ``(lower, upper, daemon.verdict.Evidence(...))``. On a trace that was cut its answer only
    counts when it ``judges_prefixes``: when it takes what is not recorded yet for unknown.
    """

    judge: Callable[..., Any]
    unit: str
    doc: str = ""
    arguments: tuple[str, ...] = ()
    judges_prefixes: bool = False


def custom_signal_names() -> tuple[str, ...]:
    """Names of the signals that plug in, without loading any."""
    return _names(SIGNAL_GROUP)


def custom_oracle_names() -> tuple[str, ...]:
    """Names of the oracles that plug in, without loading any."""
    return _names(ORACLE_GROUP)


def custom_signal(name: str) -> CustomSignal | None:
    """Return the signal that plugs in as ``name``, ``None`` when there is none.

    Raises ``ValueError`` when it cannot be loaded or is no :class:`CustomSignal` that can be used.
    """
    loaded = _loaded(SIGNAL_GROUP, name)
    if loaded is None:
        return None
    if not isinstance(loaded, CustomSignal):
        raise ValueError(_unlike("signal", name, "a grammars.oracle.CustomSignal", loaded))
    _check_declaration("signal", name, loaded.sample, loaded.unit, loaded.arguments)
    return loaded


def custom_oracle(name: str) -> CustomOracle | None:
    """Return the oracle that plugs in as ``name``, ``None`` when there is none.

    Raises ``ValueError`` when it cannot be loaded or is no :class:`CustomOracle` that can be used.
    """
    loaded = _loaded(ORACLE_GROUP, name)
    if loaded is None:
        return None
    if not isinstance(loaded, CustomOracle):
        raise ValueError(_unlike("oracle", name, "a grammars.oracle.CustomOracle", loaded))
    _check_declaration("oracle", name, loaded.judge, loaded.unit, loaded.arguments)
    return loaded


def dimension_of(unit: str) -> Dimension | None:
    """Return the dimension of an SI unit, ``None`` for ``bool``; ``ValueError`` for others."""
    if unit == "bool":
        return None
    quantity = read_quantity("1" if unit == "1" else f"1 {unit}")
    if quantity.value != 1.0:
        raise ValueError(f'"{unit}" is not an SI unit: values are kept in {quantity.unit}')
    return dimension(quantity.dimension)


@functools.cache
def _entries(group: str) -> dict[str, EntryPoint]:
    from importlib.metadata import entry_points

    found = sorted(entry_points(group=group), key=lambda entry: (entry.name, entry.value))
    return {entry.name: entry for entry in reversed(found) if _NAME.fullmatch(entry.name)}


def _names(group: str) -> tuple[str, ...]:
    return tuple(sorted(_entries(group)))


@functools.cache
def _loaded(group: str, name: str) -> object | None:
    entry = _entries(group).get(name)
    if entry is None:
        return None
    try:
        loaded: object = entry.load()
    except (Exception, SystemExit) as error:
        kind = "signal" if group == SIGNAL_GROUP else "oracle"
        what = f'the {kind} "{name}" ({origin(entry)}) cannot be loaded'
        raise ValueError(explain(what, error, __file__)) from error
    return loaded


def _check_declaration(
    kind: str, name: str, function: object, unit: object, arguments: object
) -> None:
    if not callable(function):
        raise ValueError(f'the {kind} "{name}" has no function to call')
    if not isinstance(arguments, tuple) or "bool" in arguments:
        raise ValueError(f'the {kind} "{name}" must declare its arguments as a tuple of units')
    for declared in (unit, *arguments):
        try:
            dimension_of(str(declared))
        except ValueError as error:
            raise ValueError(f'the {kind} "{name}" declares {declared!r}: {error}') from error


def _unlike(kind: str, name: str, wanted: str, found: object) -> str:
    return f'the {kind} "{name}" must be {wanted}, not {type(found).__name__}'
