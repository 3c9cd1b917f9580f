"""Plug-ins by entry point: saying whose they are and what went wrong in them."""

from __future__ import annotations

import traceback
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


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
