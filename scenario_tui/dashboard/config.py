"""The user's settings of the dashboard: ``config.toml`` in the user's configuration folder.

[dashboard]
theme = "nord"
read-only = true
mouse = false
pictures = "auto"

[keys]
cancel = "ctrl+d"
open = ["enter", "l"]

[themes.lab]
primary = "#88c0d0"
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import platformdirs

from grammars.text.diagnostics import Diagnostic, InputError, Where

if TYPE_CHECKING:
    from scenario_tui.dashboard.config_file import Pictures

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
    pictures: Pictures = "off"
    keys: Mapping[str, str] = field(default_factory=dict)
    themes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    # The text is kept because names of keys and themes are checked later, by those who know them,
    # and the line is wanted then, too.
    def where(self, table: str, name: str = "") -> Where:
        """Return where something of a table is written, as well as it can be found."""
        return Where(str(self.path or ""), _line(self.text, table, name))


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
    # Most people have no such file, and the dashboard is to be there at once.
    from scenario_tui.dashboard.config_file import read_settings

    return Config(path, text, **read_settings(path, text, Config(path, text).where))


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
