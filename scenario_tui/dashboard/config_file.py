"""What may stand in ``config.toml``, and what is wrong with one, in words and with its lines."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from grammars.text.diagnostics import Diagnostic, InputError, Where, did_you_mean
from grammars.text.documents import plain_message

Pictures = Literal["off", "auto", "kitty", "sixel"]
"""Whether maps are shown as pictures when asked for, and by which protocol of the terminal."""
Finder: TypeAlias = Callable[..., Where]
"""Says where a table of the file is written, or a name in it: ``find(table, name="")``."""
_AT: Final = re.compile(r"\(at line (\d+), column (\d+)\)")
_WRONG_TYPE: Final = {
    "string_type": "must be a text in quotes",
    "bool_type": "must be true or false",
    "float_type": "must be a number",
    # The only setting with a choice of words.
    "literal_error": f"must be one of {', '.join(get_args(Pictures))}",
}


def _colour(value: object) -> str:
    if not isinstance(value, str):
        raise PydanticCustomError("colour", 'must be a colour in quotes, such as "#88c0d0"')
    # Only files with themes of their own pay for what knows colours.
    from textual.color import Color, ColorParseError

    try:
        Color.parse(value)
    except ColorParseError as error:
        message = f'is no colour: "{value}" (write "#88c0d0")'
        raise PydanticCustomError("colour", "{message}", {"message": message}) from error
    return value


def _keys(value: Any) -> str:
    keys = value if isinstance(value, list) else [value]
    if not keys or not all(isinstance(key, str) and key.strip(" ,") for key in keys):
        raise PydanticCustomError("keys", "must be a key in quotes, or a list of them")
    return ",".join(part.strip() for key in keys for part in key.split(",") if part.strip())


_Colour = Annotated[str, BeforeValidator(_colour)]
_Keys = Annotated[str, BeforeValidator(_keys)]


class _Table(BaseModel):
    """A table of the file: a word nobody knows is a mistake, and so is ``"yes"`` for ``true``."""

    # Named with hyphens, as TOML files are written; the errors of pydantic name them so, too.

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        alias_generator=lambda name: name.replace("_", "-"),
    )

    @classmethod
    def names(cls) -> list[str]:
        return [field.alias or name for name, field in cls.model_fields.items()]


class _DashboardTable(_Table):
    theme: str = ""
    read_only: bool = False
    mouse: bool = True
    pictures: Pictures = "off"


class _ThemeTable(_Table):
    """What :class:`textual.theme.Theme` takes; only what the file sets is handed to it."""

    primary: _Colour
    secondary: _Colour = ""
    warning: _Colour = ""
    error: _Colour = ""
    success: _Colour = ""
    accent: _Colour = ""
    foreground: _Colour = ""
    background: _Colour = ""
    surface: _Colour = ""
    panel: _Colour = ""
    boost: _Colour = ""
    dark: bool = True
    ansi: bool = False
    luminosity_spread: float = 0.0
    text_alpha: float = 0.0


class _ConfigFile(_Table):
    dashboard: _DashboardTable = Field(default_factory=_DashboardTable)
    keys: dict[str, _Keys] = Field(default_factory=dict)
    themes: dict[str, _ThemeTable] = Field(default_factory=dict)


def read_settings(path: Path, text: str, find: Finder) -> dict[str, Any]:
    """Return what the text of a file says, by the names of the fields of a ``Config``.

    Raises :class:`InputError` as :func:`~scenario_tui.dashboard.config.read_config` does.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(_no_toml(path, error)) from error
    try:
        file = _ConfigFile.model_validate(data)
    except ValidationError as error:
        found = (_problem(find, one) for one in error.errors())
        # pydantic goes through the settings it knows; people read their file from the top.
        raise InputError(sorted(found, key=lambda one: one.where.line)) from error
    themes = {name: theme.model_dump(exclude_unset=True) for name, theme in file.themes.items()}
    return {**dict(file.dashboard), "keys": file.keys, "themes": themes}


def _no_toml(path: Path, error: tomllib.TOMLDecodeError) -> Diagnostic:
    at = _AT.search(str(error))
    where = Where(str(path), int(at[1]), int(at[2])) if at else Where(str(path))
    said = _AT.sub("", str(error)).strip()
    return Diagnostic(where, f"is no TOML: {said}")


def _problem(find: Finder, error: ErrorDetails) -> Diagnostic:
    """Return what pydantic found, in the words and with the places of the file."""
    *tables, name = map(str, error["loc"])
    kind, table = error["type"], ".".join(tables)
    if kind in ("model_type", "dict_type"):
        if tables:
            return Diagnostic(find(table, name), f"must be a table: [{table}.{name}]")
        return Diagnostic(find("", name), f'"{name}" must be a table: [{name}]')
    if kind == "missing":
        return Diagnostic(find(table), f'theme "{tables[-1]}" needs a colour "{name}"')
    if kind != "extra_forbidden":
        message = _WRONG_TYPE.get(kind) or plain_message(error)
        return Diagnostic(find(table, name), f'"{name}" {message}')
    return _unknown_name(find, tables, name, isinstance(error["input"], dict))


def _unknown_name(find: Finder, tables: list[str], name: str, is_table: bool) -> Diagnostic:
    if not tables:
        where = find(name) if is_table else find("", name)
        hint = did_you_mean(name, _ConfigFile.names())
        if name in _DashboardTable.names():
            hint = "did you mean to write it below [dashboard]?"
        return Diagnostic(where, f'unknown table or setting "{name}"', hint)
    where = find(".".join(tables), name)
    if tables == ["dashboard"]:
        hint = did_you_mean(name, _DashboardTable.names())
        return Diagnostic(where, f'unknown setting "{name}"', hint)
    message = f'"{name}" is nothing a theme has; {did_you_mean(name, _ThemeTable.names())}'
    return Diagnostic(where, message)
