"""What runs need at a worker, fetched by digest, verified and kept: scenes and files of SUTs."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

from daemon.batch.run_process import FILES
from daemon.batch.stores import download, file_sha256, trim_cache
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._connection import DaemonConnection, WorkerPaths
from daemon.model.attachments import LARGEST_FILE, attached_digests
from daemon.model.messages import FileDownloadRequest, IdRequest
from daemon.model.verbs import FILE, SCENE
from grammars.model.scene import Scene
from grammars.text import codec
from grammars.text.files import move_durably, write_atomically

_MOST_SCENES: Final = 256
_SCENE_IN_USE: Final = 600.0
"""Seconds after its last use during which a scene stays: a run may be about to read it."""


class SceneCache:
    """The scenes that lie here."""

    def __init__(self, link: DaemonConnection, base: WorkerPaths) -> None:
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
        scene = self._link.ask(SCENE, IdRequest(digest))
        if scene.digest != digest:
            raise ValueError(f"the daemon sent {scene.digest[:12]} for the scene {digest[:12]}")
        write_atomically(path, codec.to_json(scene))
        if not self._base.shared:
            self._bound()

    def _bound(self) -> None:
        """Remove the scenes that were not used for longest when there are too many."""
        scenes = self._base.places.scenes.glob("*.json")
        trim_cache(scenes, _MOST_SCENES, lambda _: 1, _SCENE_IN_USE)


_LARGEST_FILE_CACHE: Final = 2 * 2**30
_FILE_IN_USE: Final = 24 * 3600.0
"""Seconds after its last use during which a file stays: no run takes longer."""


class FileCache:
    """The files that lie here; ``meanwhile`` is called between parts of one that comes."""

    def __init__(
        self, link: DaemonConnection, base: WorkerPaths, meanwhile: Callable[[], None]
    ) -> None:
        self._link = link
        self._base = base
        self._meanwhile = meanwhile
        self._good: set[str] = set()

    def lay_out(self, attempt: Attempt) -> None:
        """Put what the system under test of an attempt needs within its reach, if it needs any.

        Raises ``ValueError`` for a file that is not the one its digest names, ``OSError``, and
        whatever asking the daemon raises.
        """
        digests = attached_digests(attempt.grant.spec.sut.parameters).values()
        for digest in digests:
            self._ensure(digest)
        if digests:
            (attempt.folder / FILES).symlink_to(self._base.places.files)

    def _ensure(self, digest: str) -> None:
        path = self._base.places.files / digest
        if digest not in self._good or not path.exists():
            if not path.exists() or file_sha256(path) != digest:
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
            download(
                part,
                lambda offset: self._link.ask(FILE, FileDownloadRequest(digest, offset)),
                largest=LARGEST_FILE,
                progress=lambda _: self._meanwhile(),
            )
            if file_sha256(part) != digest:
                raise ValueError(f"the daemon sent another file for {digest[:12]}")
            part.chmod(0o400)
            move_durably(part, path)
        finally:
            part.unlink(missing_ok=True)
        self._bound()

    def _bound(self) -> None:
        """Remove what was not used for longest until the cache is as small as it should be."""
        files = self._base.places.files.iterdir()
        trim_cache(files, _LARGEST_FILE_CACHE, lambda found: found.st_size, _FILE_IN_USE)
