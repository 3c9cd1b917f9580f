"""Versions have to be equal wherever runs are executed: same specification, same bytes."""

from __future__ import annotations

from importlib.metadata import version

from daemon.spec import ENGINE_VERSION

_PACKAGE = "scenario-tui"


def identity() -> str:
    """Package and engine of this process, for comparison and for people."""
    return f"{_PACKAGE} {version(_PACKAGE)}, engine {ENGINE_VERSION}"


def remedy(wanted: str) -> str:
    """What to do where ``wanted``, an :func:`identity`, is not what is installed."""
    number = wanted.removeprefix(f"{_PACKAGE} ").partition(",")[0]
    return f"pip install '{_PACKAGE}=={number}' there"
