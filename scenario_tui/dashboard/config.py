"""The user's settings of the dashboard: ``config.toml`` in the user's configuration folder.

[dashboard]
theme = "nord"
read-only = true
mouse = false

[keys]
cancel = "ctrl+d"
open = ["enter", "l"]

[themes.lab]
primary = "#88c0d0"
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import platformdirs

from grammars.text.diagnostics import Diagnostic, InputError, Where, did_you_mean

_TABLES: Final = ("dashboard", "keys", "themes")
_SETTINGS: Final[Mapping[str, type]] = {"theme": str, "read-only": bool, "mouse": bool}
_WORDS: Final = {str: "a text in quotes", bool: "true or false"}
_THEME_SWITCHES: Final = ("dark", "ansi")
_THEME_NUMBERS: Final = ("luminosity-spread", "text-alpha")
_THEME_COLOURS: Final = (
    "primary", "secondary", "warning", "error", "success", "accent", "foreground", "background",
    "surface", "panel", "boost",
)  # fmt: skip
_AT: Final = re.compile(r"\(at line (\d+), column (\d+)\)")
_HEADER: Final = re.compile(r"\s*\[\s*([^\[\]]+?)\s*\]")


@dataclass(frozen=True, slots=True)
class Config:
    """What ``path`` says; everything has a default, also when there is no such file.

    ``keys`` maps ids of bindings to keys, several separated by commas. ``themes`` holds the
    colours and switches of each theme, as their names in :class:`textual.theme.Theme`.
    """

    path: Path | None = None
    text: str = field(default="", repr=False)
    theme: str = ""
    read_only: bool = False
    mouse: bool = True
    keys: Mapping[str, str] = field(default_factory=dict)
    themes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def where(self, table: str, name: str = "") -> Where:
        """Return where something of a table is written, as well as it can be found."""
        return Where(str(self.path or ""), _line(self.text, table, name))

    def check_keys(self, known: Iterable[str]) -> None:
        """Raise :class:`InputError` for ids of bindings there are not."""
        ids = tuple(known)
        wrong = [name for name in self.keys if name not in ids]
        if wrong:
            raise InputError(self._unknown(name, ids) for name in wrong)

    def _unknown(self, name: str, ids: tuple[str, ...]) -> Diagnostic:
        message = f'unknown key id "{name}"; ids are {", ".join(sorted(ids))}'
        return Diagnostic(
            self.where("keys", name), message, "`scenario tui --bindings` says what they do"
        )

    def check_theme(self, known: Iterable[str]) -> None:
        """Raise :class:`InputError` for a theme that is neither built in nor in the file."""
        names = (*known, *self.themes)
        if self.theme and self.theme not in names:
            message = f'unknown theme "{self.theme}"; themes are {", ".join(sorted(names))}'
            raise InputError(Diagnostic(self.where("dashboard", "theme"), message))


def config_path() -> Path:
    """Return where the user's settings are looked for."""
    return platformdirs.user_config_path("scenario") / "config.toml"


def read_config(path: Path | None = None) -> Config:
    """Read the settings; a file that is not there says nothing.

    Raises :class:`InputError` for what is no TOML, unknown tables and settings, and values of
    another kind. Names of keys and themes are checked by whoever knows them.
    """
    path = path or config_path()
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return Config(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is no UTF-8 text"
        raise InputError(Diagnostic(Where(str(path)), f"cannot be read: {reason}")) from error
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(_no_toml(path, error)) from error
    config = Config(path, text)
    found = tuple(_problems(config, data))
    if found:
        raise InputError(found)
    dashboard = data.get("dashboard", {})
    return Config(
        path,
        text,
        theme=dashboard.get("theme", ""),
        read_only=dashboard.get("read-only", False),
        mouse=dashboard.get("mouse", True),
        keys={name: _keys(keys) for name, keys in data.get("keys", {}).items()},
        themes={name: _theme(body) for name, body in data.get("themes", {}).items()},
    )


def _no_toml(path: Path, error: tomllib.TOMLDecodeError) -> Diagnostic:
    at = _AT.search(str(error))
    where = Where(str(path), int(at[1]), int(at[2])) if at else Where(str(path))
    said = _AT.sub("", str(error)).strip()
    return Diagnostic(where, f"is no TOML: {said}")


def _problems(config: Config, data: Mapping[str, Any]) -> Iterator[Diagnostic]:
    for table, body in data.items():
        if table not in _TABLES:
            message = f'unknown table or setting "{table}"'
            place = config.where(table) if isinstance(body, dict) else config.where("", table)
            hint = "did you mean to write it below [dashboard]?" if table in _SETTINGS else ""
            yield Diagnostic(place, message, hint or did_you_mean(table, _TABLES))
        elif not isinstance(body, dict):
            yield Diagnostic(config.where("", table), f'"{table}" must be a table: [{table}]')
        else:
            yield from _CHECKS[table](config, body)


def _dashboard_problems(config: Config, body: Mapping[str, Any]) -> Iterator[Diagnostic]:
    for name, value in body.items():
        kind = _SETTINGS.get(name)
        where = config.where("dashboard", name)
        if kind is None:
            yield Diagnostic(where, f'unknown setting "{name}"', did_you_mean(name, _SETTINGS))
        elif not isinstance(value, kind):
            yield Diagnostic(where, f'"{name}" must be {_WORDS[kind]}')


def _key_problems(config: Config, body: Mapping[str, Any]) -> Iterator[Diagnostic]:
    for name, value in body.items():
        keys = value if isinstance(value, list) else [value]
        if not keys or not all(isinstance(key, str) and key.strip(" ,") for key in keys):
            message = f'"{name}" must be a key in quotes, or a list of them'
            yield Diagnostic(config.where("keys", name), message)


def _theme_problems(config: Config, body: Mapping[str, Any]) -> Iterator[Diagnostic]:
    for theme, values in body.items():
        table = f"themes.{theme}"
        if not isinstance(values, dict):
            yield Diagnostic(config.where("themes", theme), f"must be a table: [themes.{theme}]")
            continue
        if "primary" not in values:
            yield Diagnostic(config.where(table), f'theme "{theme}" needs a colour "primary"')
        for name, value in values.items():
            expected = _expected(name, value)
            if expected:
                yield Diagnostic(config.where(table, name), f'"{name}" {expected}')


def _expected(name: str, value: object) -> str:
    """Return what is wrong with one value of a theme, empty when nothing is."""
    if name in _THEME_COLOURS:
        if not isinstance(value, str):
            return 'must be a colour in quotes, such as "#88c0d0"'
        return "" if _is_colour(value) else f'is no colour: "{value}" (write "#88c0d0")'
    if name in _THEME_SWITCHES:
        return "" if isinstance(value, bool) else "must be true or false"
    if name in _THEME_NUMBERS:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return "" if number else "must be a number"
    known = (*_THEME_COLOURS, *_THEME_SWITCHES, *_THEME_NUMBERS)
    return f"is nothing a theme has; {did_you_mean(name, known)}"


def _is_colour(text: str) -> bool:
    # Only files with themes of their own pay for what knows colours.
    from textual.color import Color, ColorParseError

    try:
        Color.parse(text)
    except ColorParseError:
        return False
    return True


def _keys(value: str | list[str]) -> str:
    keys = value if isinstance(value, list) else [value]
    parts = [part.strip() for key in keys for part in (key.split(",") if key != "," else ["comma"])]
    return ",".join(part for part in parts if part)


def _theme(body: Mapping[str, Any]) -> dict[str, Any]:
    return {name.replace("-", "_"): value for name, value in body.items()}


def _line(text: str, table: str, name: str) -> int:
    """Return the line of a name in a table, else of the table, else 0; TOML keeps no places."""
    inside, begins = "", 0
    entry = re.compile(rf"\s*[\"']?{re.escape(name)}[\"']?\s*[=.]")
    for number, line in enumerate(text.splitlines(), 1):
        header = _HEADER.match(line)
        if header:
            inside = re.sub(r"[\"'\s]", "", header[1])
            begins = number if inside == table else begins
        elif name and inside == table and entry.match(line):
            return number
        elif not inside and not name and re.match(rf"\s*{re.escape(table)}\s*[=.]", line):
            begins = number
    return begins


_CHECKS: Final = {
    "dashboard": _dashboard_problems,
    "keys": _key_problems,
    "themes": _theme_problems,
}
