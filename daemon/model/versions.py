"""Versions have to be equal wherever runs are executed: same specification, same bytes."""

from __future__ import annotations

import functools
from importlib.metadata import PackageNotFoundError, version
from typing import Final

from daemon.model.spec import ENGINE_VERSION

_PACKAGE: Final = "scenario-tui"
_DECIDE_TRACES: Final = (_PACKAGE, "numpy", "numba", "pymunk", "mcap", "rosbags")


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


def package_versions() -> dict[str, str]:
    """Versions of everything that can change a trace, for its metadata."""
    return {name: _installed_version(name) for name in _DECIDE_TRACES}


# Looked up once per process: it reads the metadata of an installed package from disk, and the
# parent of forked runs does so for all of them.
@functools.cache
def _installed_version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
