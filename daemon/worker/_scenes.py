"""Scenes at a worker: fetched by digest, verified, kept for the runs to come."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.messages import Named, Verb
from daemon.places import write_atomically
from grammars import codec
from grammars.scene import Scene

if TYPE_CHECKING:
    from daemon.worker._agent import Link
    from daemon.worker._base import Base

_MOST: Final = 256
_RECENT: Final = 600.0
"""Seconds after its last use during which a scene stays: a run may be about to read it."""


class Scenes:
    """The scenes that lie here."""

    def __init__(self, link: Link, base: Base) -> None:
        self._link = link
        self._base = base
        self._good: set[str] = set()

    def path(self, digest: str) -> Path:
        """Return the file of a scene, fetching it if need be.

        Raises ``ValueError`` for a scene that is not the one its digest names, ``OSError``, and
        whatever asking the daemon raises.
        """
        path = self._base.places.scene(digest)
        if digest not in self._good or not path.exists():
            if not self._is_good(path, digest):
                self._fetch(path, digest)
            self._good.add(digest)
        if not self._base.shared:
            os.utime(path)
        return path

    def _is_good(self, path: Path, digest: str) -> bool:
        """Whether the scene lies here undamaged; one of the daemon's own cannot be mended."""
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return False
        try:
            good = codec.from_json(Scene, data).digest == digest
        except ValueError:
            good = False
        if not good and self._base.shared:
            raise ValueError(f"{path} is damaged: remove it and submit its campaign again")
        return good

    def _fetch(self, path: Path, digest: str) -> None:
        scene = self._link.ask(Verb.SCENE, Named(digest), Scene)
        if scene.digest != digest:
            raise ValueError(f"the daemon sent {scene.digest[:12]} for the scene {digest[:12]}")
        write_atomically(path, codec.to_json(scene))
        if not self._base.shared:
            self._bound()

    def _bound(self) -> None:
        """Remove the scenes that were not used for longest when there are too many."""
        files = [(path.stat().st_mtime, path) for path in self._base.places.scenes.glob("*.json")]
        now = time.time()
        for used, path in sorted(files)[:-_MOST]:
            if now - used > _RECENT:
                with suppress(FileNotFoundError):
                    path.unlink()
                self._good.discard(path.stem)
