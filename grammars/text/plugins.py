"""Code of other people that may be installed: plug-ins by entry point, and optional libraries."""

from __future__ import annotations

import functools
import importlib
import re
import traceback
from typing import TYPE_CHECKING, Any, Final

from grammars.text.diagnostics import Finding, InputError, Where

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*(\.[A-Za-z0-9_][A-Za-z0-9_-]*)*")
"""What can be named in a line of a language; others are as good as not there."""


@functools.cache
def installed(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name, none of them loaded."""
    from importlib.metadata import entry_points

    found = sorted(entry_points(group=group), key=lambda entry: (entry.name, entry.value))
    # Of two of one name the first by what it points to counts: the order in which packages are
    # found differs between machines.
    return {entry.name: entry for entry in reversed(found) if _NAME.fullmatch(entry.name)}


def plugin_names(group: str) -> tuple[str, ...]:
    """Return the names of the plug-ins of a group, without loading any."""
    return tuple(sorted(installed(group)))


@functools.cache
def load_plugin(group: str, name: str, what: str) -> object | None:
    """Return the object a plug-in names, ``None`` when there is no such plug-in.

    Raises ``ValueError`` when it cannot be loaded; ``what`` it is, such as ``signal``, is said.
    """
    entry = installed(group).get(name)
    if entry is None:
        return None
    try:
        loaded: object = entry.load()
    except (Exception, SystemExit) as error:
        # Code of other people: at import it may do anything, leave the program included.
        problem = f'the {what} "{name}" ({plugin_origin(entry)}) cannot be loaded'
        raise ValueError(explain_plugin_error(problem, error, __file__)) from error
    return loaded


def plugin_origin(entry: EntryPoint) -> str:
    """Return what an entry point names and the package that does: ``a.b:c, package a 1.0``."""
    package = f", package {entry.dist.name} {entry.dist.version}" if entry.dist else ""
    return f"{entry.value}{package}"


def explain_plugin_error(what: str, error: BaseException, caller: str) -> str:
    """Return ``<what>: <kind of error>: <message> (<file>:<line>)`` for an error in a plug-in.

    ``caller`` is the file that called it, which is not where the error is.
    """
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if "importlib" not in f.filename and f.filename != caller]
    place = f" ({own[-1].filename}:{own[-1].lineno})" if own else ""
    return f"{what}: {type(error).__name__}: {error}{place}"


class MissingExtraError(InputError):
    """An optional library is not installed; the message says what for, and what installs it."""


def load_extra(module: str, extra: str, purpose: str, where: str) -> Any:
    """Import ``module``, which comes with the extra ``extra`` of this package.

    ``purpose`` is what takes it, ``where`` the part of this tool that is speaking. Raises
    :class:`MissingExtraError`.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        library = module.partition(".")[0]
        message = f"{purpose} takes the library {library}, which is not installed"
        hint = f'install it with: pip install "scenario-tui[{extra}]"'
        raise MissingExtraError(Finding(Where(where), message, hint)) from error
