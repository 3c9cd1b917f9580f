"""Help as it is shown: flags without ``<bool>``, in colours."""

from __future__ import annotations

import inspect
import sys
from contextlib import redirect_stdout
from typing import Any

from typer.core import TyperCommand, TyperGroup, TyperOption

from grammars.text.terminal_text import unfiltered


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
        """Print the help, whose words are all ours, in colours."""
        # typer joins the lines of the first paragraph only.
        paragraphs = inspect.cleandoc(self.help or "").split("\n\n")
        self.help: str | None = "\n\n".join(" ".join(one.split()) for one in paragraphs)
        # rich, which typer prints it with, writes its styles as text of this stream.
        with redirect_stdout(unfiltered(sys.stdout)):
            super().format_help(ctx, formatter)  # type: ignore[misc]


class PlainFlagsCommand(_PlainFlags, TyperCommand):
    """A command whose flags are shown without ``<bool>``."""


class PlainFlagsGroup(_PlainFlags, TyperGroup):
    """A group of commands whose flags are shown without ``<bool>``."""
