"""Help without types where there is nothing to write: a flag takes no value."""

from __future__ import annotations

from typing import Any

from typer.core import TyperCommand, TyperGroup, TyperOption


class Command(TyperCommand):
    """A command whose flags are shown without ``<bool>``."""

    def get_params(self, ctx: Any) -> Any:
        """Return the parameters as help shows them."""
        return _bare(super().get_params(ctx))


class Group(TyperGroup):
    """A group of commands whose flags are shown without ``<bool>``."""

    def get_params(self, ctx: Any) -> Any:
        """Return the parameters as help shows them."""
        return _bare(super().get_params(ctx))


def _bare(parameters: list[Any]) -> list[Any]:
    for parameter in parameters:
        if isinstance(parameter, TyperOption) and parameter.is_flag and parameter.metavar is None:
            parameter.metavar = ""
    return parameters
