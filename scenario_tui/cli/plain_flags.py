"""Help as it is shown: flags without ``<bool>``, in colours, quickly."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from types import ModuleType
from typing import Any, Final

from typer.core import TyperCommand, TyperGroup, TyperOption

from grammars.text.terminal_text import unfiltered

_UNUSED: Final = {"rich.markdown": "Markdown", "rich.traceback": "Traceback"}
"""Modules, each with the class of it, that typer imports with its help and that nothing of ours
has it use: our help is not written in Markdown, and what goes wrong is reported by ourselves. They
take twice as long as the rest of it."""


class _ImportedWhenUsed(type):
    """Stands for a class whose module is imported when the class is used."""

    def __call__(cls, *arguments: Any, **options: Any) -> Any:
        """Make an object of the real class."""
        return cls._find()(*arguments, **options)

    def __getattr__(cls, name: str) -> Any:
        return getattr(cls._find(), name)

    def _find(cls) -> Any:
        return getattr(importlib.import_module(cls.__module__), cls.__name__)


def _stand_in(module: str, name: str) -> ModuleType:
    found = ModuleType(module)
    setattr(found, name, _ImportedWhenUsed(name, (), {"__module__": module}))
    return found


def load_help_pages() -> None:
    """Import what typer shows help and wrong usage with, without what only others need of it."""
    lacking = [name for name in _UNUSED if name not in sys.modules]
    sys.modules.update((name, _stand_in(name, _UNUSED[name])) for name in lacking)
    try:
        importlib.import_module("typer.rich_utils")
    finally:
        for name in lacking:
            del sys.modules[name]


@contextmanager
def _coloured_help() -> Iterator[None]:
    """Let the help, whose words are all ours, be printed in colours."""
    load_help_pages()
    # rich, which typer prints it with, writes its styles as text of this stream.
    with redirect_stdout(unfiltered(sys.stdout)):
        yield


class _PlainFlags:
    """Shows flags without the ``<bool>`` that typer puts behind them, and help in colours."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters as help shows them."""
        parameters: list[Any] = super().get_params(ctx)  # type: ignore[misc]
        for one in parameters:
            if isinstance(one, TyperOption) and one.is_flag and one.metavar is None:
                one.metavar = ""
        return parameters

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help in colours."""
        with _coloured_help():
            super().format_help(ctx, formatter)  # type: ignore[misc]


class PlainFlagsCommand(_PlainFlags, TyperCommand):
    """A command whose flags are shown without ``<bool>``."""


class PlainFlagsGroup(_PlainFlags, TyperGroup):
    """A group of commands whose flags are shown without ``<bool>``."""
