"""The user's settings of the dashboard: ``config.toml`` in the user's configuration folder.

[dashboard]
theme = "nord"
read-only = true
mouse = false

[keys]
cancel = "ctrl+d"
open = ["enter", "l"]
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from grammars.text.diagnostics import Finding, InputError, Where
from grammars.text.files import user_folder
from grammars.text.sources import read_text


@dataclass(frozen=True, slots=True)
class Config:
    """Settings of the file at ``path``, ``None`` without a file.

    ``keys`` maps ids of bindings to keys, several separated by commas.
    """

    path: Path | None = None
    theme: str = ""
    read_only: bool = False
    mouse: bool = True
    keys: Mapping[str, str] = field(default_factory=dict)


def config_path() -> Path:
    """Return the path of the user's settings."""
    return user_folder("config") / "config.toml"


def read_config(path: Path | None = None) -> Config:
    """Read the settings; without a file, the defaults apply.

    Raises :class:`InputError` for unreadable files, invalid TOML, unknown tables and settings, and
    values of another kind. Names of keys and themes are checked elsewhere.
    """
    path = path or config_path()
    if not path.exists():
        return Config()
    try:
        data = tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise InputError(Finding(Where(str(path)), f"is not valid TOML: {error}")) from error
    # Imported here, because most people have no such file and the dashboard must start fast.
    from pydantic import BaseModel, Field, ValidationError

    class DashboardTable(BaseModel, extra="forbid", strict=True):
        theme: str = ""
        read_only: bool = Field(default=False, alias="read-only")
        mouse: bool = True

    class ConfigFile(BaseModel, extra="forbid", strict=True):
        dashboard: DashboardTable = DashboardTable()
        keys: dict[str, str | list[str]] = Field(default_factory=dict)

    try:
        file = ConfigFile.model_validate(data)
    except ValidationError as error:
        raise InputError(
            Finding(Where(str(path)), f"{'.'.join(map(str, one['loc']))}: {one['msg']}")
            for one in error.errors()
        ) from error
    keys = {
        name: keys if isinstance(keys, str) else ",".join(keys) for name, keys in file.keys.items()
    }
    return Config(path, **dict(file.dashboard), keys=keys)
