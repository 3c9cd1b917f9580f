"""Plug-ins by entry point, and optional libraries."""

from __future__ import annotations

import functools
import importlib
import json
import re
import traceback
from typing import TYPE_CHECKING, Any, Final

from grammars.text.diagnostics import Finding, InputError, Where

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*(\.[A-Za-z0-9_][A-Za-z0-9_-]*)*")
"""Names that a line of a language can hold; plug-ins with other names are ignored."""


@functools.cache
def installed(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name, without loading them."""
    from importlib.metadata import entry_points

    # The order of packages differs between machines: of two entries with one name, the first by
    # its target counts.
    entries = sorted(entry_points(group=group), key=lambda entry: (entry.name, entry.value))
    return {entry.name: entry for entry in reversed(entries) if _NAME.fullmatch(entry.name)}


def plugin_names(group: str) -> tuple[str, ...]:
    """Return the names of the plug-ins of a group, without loading them."""
    return tuple(sorted(installed(group)))


@functools.cache
def load_plugin(group: str, name: str, kind: str) -> object | None:
    """Return the object of a plug-in, ``None`` if the plug-in does not exist.

    Raises ``ValueError`` if loading fails; ``kind`` names the plug-in in its message: ``signal``.
    """
    entry = installed(group).get(name)
    if entry is None:
        return None
    try:
        loaded: object = entry.load()
    except (Exception, SystemExit) as error:
        # Foreign code may do anything at import, even exit the program.
        problem = f'the {kind} "{name}" ({plugin_origin(entry)}) cannot be loaded'
        raise ValueError(explain_plugin_error(problem, error, __file__)) from error
    return loaded


def plugin_origin(entry: EntryPoint) -> str:
    """Return the target and the package of an entry point: ``a.b:c, package a 1.0``."""
    package = f", package {entry.dist.name} {entry.dist.version}" if entry.dist else ""
    return f"{entry.value}{package}"


def explain_plugin_error(problem: str, error: BaseException, caller: str) -> str:
    """Return ``<problem>: <kind of error>: <message> (<file>:<line>)`` for an error in a plug-in.

    The place is never in ``caller``, the file that called the plug-in.
    """
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if "importlib" not in f.filename and f.filename != caller]
    place = f" ({own[-1].filename}:{own[-1].lineno})" if own else ""
    return f"{problem}: {type(error).__name__}: {error}{place}"


class MissingExtraError(InputError):
    """An optional library is not installed; the message names its purpose and how to install it."""


def install_command(extra: str) -> str:
    """Return the command that adds an extra to this package, from the place it came from."""
    from importlib.metadata import distribution
    from urllib.parse import unquote, urlsplit

    origin = json.loads(distribution("scenario-tui").read_text("direct_url.json") or "{}")
    # Built from a folder, the package may be in no index.
    place = unquote(urlsplit(origin["url"]).path) if "dir_info" in origin else "scenario-tui"
    editable = "-e " if origin.get("dir_info", {}).get("editable") else ""
    return f"pip install {editable}'{place}[{extra}]'"


def load_extra(module: str, extra: str, purpose: str, where: str) -> Any:
    """Import ``module``, which comes with the extra ``extra`` of this package.

    ``purpose`` names the feature that needs it, ``where`` the part of this tool that reports.
    Raises :class:`MissingExtraError`.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        library = module.partition(".")[0]
        message = f"{purpose} needs the library {library}, which is not installed"
        hint = f"install it with: {install_command(extra)}"
        raise MissingExtraError(Finding(Where(where), message, hint)) from error
