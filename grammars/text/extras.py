"""Libraries that only some of what this tool does takes: what installs them is said when needed."""

from __future__ import annotations

import importlib
from typing import Any

from grammars.text.diagnostics import Diagnostic, InputError, Where


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
        raise MissingExtraError(Diagnostic(Where(where), message, hint)) from error
