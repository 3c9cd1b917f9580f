"""Libraries only reports need: there when the extra ``report`` is installed."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from grammars.diagnostics import Diagnostic, InputError, Where


def needed(module: str, purpose: str) -> ModuleType:
    """Import a library of the extra ``report``.

    Raises :class:`InputError` that says how to get it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        message = f"{purpose} takes the library {name}, which is not installed"
        hint = 'install it with: pip install "scenario-tui[report]"'
        raise InputError(Diagnostic(Where("scenario report"), message, hint)) from error
