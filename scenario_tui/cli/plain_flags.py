"""Help as it is shown: flags without ``<bool>``, in colours, quickly."""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from types import ModuleType
from typing import Any, ClassVar, Final

from typer.core import TyperCommand, TyperGroup, TyperOption

from grammars.text.terminal_text import unfiltered

_UNUSED: Final = {"rich.markdown": "Markdown", "rich.traceback": "Traceback"}
"""Modules, each with the class of it, that typer imports with its help and that nothing of ours
has it use: our help is not written in Markdown, and what goes wrong is reported by ourselves. They
take twice as long as the rest of it."""


_COMMON: Final = ("connect", "state", "keys", "as_json", "help")
"""Parameters that many commands have, in the order help shows them."""
_COMMON_PANEL: Final = "Common options"


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

    common: ClassVar[tuple[str, ...]] = ()

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters as help shows them: what many commands have comes last."""
        parameters: list[Any] = super().get_params(ctx)  # type: ignore[misc]
        for one in parameters:
            if not isinstance(one, TyperOption):
                continue
            if one.is_flag and one.metavar is None:
                one.metavar = ""
            if one.name in self.common:
                one.rich_help_panel = _COMMON_PANEL
        return sorted(parameters, key=self._place)

    def _place(self, parameter: Any) -> int:
        named = isinstance(parameter, TyperOption) and parameter.name in self.common
        return self.common.index(parameter.name) + 1 if named else 0

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help in colours, and examples below."""
        # typer joins the lines of the first paragraph only.
        self.help: str | None = _unwrapped(self.help or "")
        with _coloured_help():
            super().format_help(ctx, formatter)  # type: ignore[misc]
            _print_examples(ctx)


def _unwrapped(text: str) -> str:
    """Return paragraphs of one line each."""
    paragraphs = inspect.cleandoc(text).split("\n\n")
    return "\n\n".join(" ".join(one.split()) for one in paragraphs)


def _print_examples(ctx: Any) -> None:
    """Print what can be typed as it stands, a line each, in no frame: to be copied."""
    from scenario_tui.cli.examples import EXAMPLES

    # Without the program's own name, which tests and pictures call otherwise.
    lines = EXAMPLES.get(ctx.command_path.partition(" ")[2], ())
    if not lines:
        return
    from typer.rich_utils import _get_rich_console

    console = _get_rich_console()
    console.print(" Examples", style="bold")
    for line in lines:
        console.print(f"   {line}", markup=False, highlight=False, soft_wrap=True)
    console.print()


class PlainFlagsCommand(_PlainFlags, TyperCommand):
    """A command whose flags are shown without ``<bool>``."""

    common = _COMMON


class PlainFlagsGroup(_PlainFlags, TyperGroup):
    """A group of commands whose flags are shown without ``<bool>``."""
