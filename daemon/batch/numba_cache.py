"""Where numba keeps compiled kernels when neither of its usual paths can be written."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import platformdirs

import daemon
from daemon.batch.paths import StatePaths

CACHE_VARIABLE: Final = "NUMBA_CACHE_DIR"


def numba_cache_environment(
    paths: StatePaths,
    environ: Mapping[str, str] = os.environ,
    usual: tuple[Path, ...] | None = None,
) -> dict[str, str]:
    """Return ``environ`` for a worker, with a cache in the state directory if it takes one.

    numba keeps what it compiles beside the sources, else in the user's cache folder, and raises
    where it can keep nothing: a container with a read-only installation and no home, say.
    ``usual`` are these two paths.
    """
    if environ.get(CACHE_VARIABLE) or any(_writable(folder) for folder in usual or _usual()):
        return dict(environ)
    return {**environ, CACHE_VARIABLE: str(paths.state / "kernels")}


def numba_cache_folder(environ: Mapping[str, str] = os.environ) -> Path:
    """Return the folder numba keeps what it compiles in, or below; processes that share it need not
    compile the same.
    """
    if asked := environ.get(CACHE_VARIABLE):
        return Path(asked)
    folders = _usual()
    return next((folder for folder in folders if _writable(folder)), folders[-1])


def _usual() -> tuple[Path, ...]:
    # The in-tree and the user-wide cache locators of numba.core.caching, in this order.
    beside = Path(daemon.__file__).parent / "__pycache__"
    return beside, platformdirs.user_cache_path("numba")


def _writable(folder: Path) -> bool:
    """Whether ``folder`` can be written, or made."""
    existing = next((f for f in (folder, *folder.parents) if f.exists()), folder)
    return os.access(existing, os.W_OK)
