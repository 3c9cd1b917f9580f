"""Versions have to be equal wherever runs are executed: same specification, same bytes."""

from __future__ import annotations

from importlib.metadata import version
from typing import Final

from daemon.model.spec import ENGINE_VERSION

_PACKAGE: Final = "scenario-tui"


def version_text(number: str, engine: str) -> str:
    """A version for comparison and for people: package and engine."""
    return f"{_PACKAGE} {number}, engine {engine}"


def own_version() -> str:
    """The version of this process."""
    return version_text(version(_PACKAGE), ENGINE_VERSION)


def install_hint(wanted: str) -> str:
    """What to do where ``wanted``, an :func:`own_version`, is not what is installed."""
    number = wanted.removeprefix(f"{_PACKAGE} ").partition(",")[0]
    return f"pip install '{_PACKAGE}=={number}' there"
