"""Files of systems under test at a worker: fetched by digest, verified, kept for runs to come."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.attachments import LARGEST_FILE, attached
from daemon.child import FILES
from daemon.messages import FetchFile, Piece, Verb
from daemon.store import add_part, sha256_of, unpacked
from daemon.worker._spool import Attempt

if TYPE_CHECKING:
    from daemon.worker._agent import Link
    from daemon.worker._base import Base

_LARGEST_CACHE: Final = 2 * 2**30
_RECENT: Final = 24 * 3600.0
"""Seconds after its last use during which a file stays: no run takes longer."""


class Files:
    """The files that lie here; ``meanwhile`` is called between parts of one that comes."""

    def __init__(self, link: Link, base: Base, meanwhile: Callable[[], None]) -> None:
        self._link = link
        self._base = base
        self._meanwhile = meanwhile
        self._good: set[str] = set()

    def lay_out(self, attempt: Attempt) -> None:
        """Put what the system under test of an attempt needs within its reach, if it needs any.

        Raises ``ValueError`` for a file that is not the one its digest names, ``OSError``, and
        whatever asking the daemon raises.
        """
        digests = attached(attempt.grant.spec.sut.parameters).values()
        for digest in digests:
            self._ensure(digest)
        if digests:
            (attempt.folder / FILES).symlink_to(self._base.places.files)

    def _ensure(self, digest: str) -> None:
        path = self._base.places.files / digest
        if digest not in self._good or not path.exists():
            if not path.exists() or sha256_of(path) != digest:
                self._fetch(path, digest)
            self._good.add(digest)
        if not self._base.shared:
            os.utime(path)

    def _fetch(self, path: Path, digest: str) -> None:
        if self._base.shared:
            raise ValueError(f"{path} is gone or damaged: submit its campaign again")
        path.parent.mkdir(mode=0o700, exist_ok=True)
        part = path.with_name(f".{digest}.{os.getpid()}.part")
        part.unlink(missing_ok=True)
        try:
            self._download(part, digest)
            if sha256_of(part) != digest:
                raise ValueError(f"the daemon sent another file for {digest[:12]}")
            part.chmod(0o400)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        self._bound()

    def _download(self, part: Path, digest: str) -> None:
        part.touch(mode=0o600)
        have, size = 0, 1
        while have < size:
            piece = self._link.ask(Verb.FILE, FetchFile(digest, have), Piece)
            size, data = min(piece.size, LARGEST_FILE), unpacked(piece.data, piece.digest)
            add_part(part, have, data)
            have += len(data)
            if not data and have < size:
                raise ValueError(f"the daemon's file {digest[:12]} is shorter than it says")
            self._meanwhile()

    def _bound(self) -> None:
        """Remove what was not used for longest until the cache is as small as it should be."""
        folder, now = self._base.places.files, time.time()
        files = sorted((path.stat().st_mtime, path) for path in folder.iterdir())
        size = sum(path.stat().st_size for _, path in files)
        for used, path in files:
            if size <= _LARGEST_CACHE or now - used < _RECENT:
                return
            size -= path.stat().st_size
            with suppress(FileNotFoundError):
                path.unlink()
            self._good.discard(path.name)
