"""What runs need at a worker, fetched by digest, verified and kept: scenes and files of SUTs."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

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
_LARGEST_FILE_CACHE: Final = 2 * 2**30
_FILE_IN_USE: Final = 24 * 3600.0
"""Seconds after its last use during which a file stays: no run takes longer."""


class InputCache:
    """The scenes and files that lie here; ``meanwhile`` is called between parts of one that comes.

    In a folder shared with the daemon they are the daemon's own: nothing of them is removed here,
    and what is damaged there is nothing a worker can mend.
    """

    def __init__(
        self, daemon: DaemonConnection, paths: WorkerPaths, meanwhile: Callable[[], None]
    ) -> None:
        self._daemon = daemon
        self._paths = paths
        self._meanwhile = meanwhile
        # Verified by this process. Each is read in full only once: a campaign of 100 000 runs
        # shares a few scenes.
        self._verified: set[str] = set()

    def scene(self, digest: str) -> Path:
        """Return the file of a scene, fetching it if need be.

        Raises ``ValueError`` for a scene that is not the one its digest names, ``OSError``, and
        whatever asking the daemon raises.
        """
        path = self._paths.state.scene(digest)
        self._ensure(path, digest, self._is_scene, self._fetch_scene)
        return path

    def provide_files(self, attempt: Attempt) -> None:
        """Put what the system under test of an attempt needs within its reach, if it needs any.

        Raises ``ValueError`` for a file that is not the one its digest names, ``OSError``, and
        whatever asking the daemon raises.
        """
        digests = attached_digests(attempt.lease.spec.sut.parameters).values()
        for digest in digests:
            self.file(digest)
        if digests:
            attempt.link_files(self._paths.state.files)

    def file(self, digest: str) -> Path:
        """Return a file of systems under test; like :meth:`scene`."""
        path = self._paths.state.files / digest
        self._ensure(path, digest, _is_file, self._fetch_file)
        return path

    def _ensure(
        self,
        path: Path,
        digest: str,
        is_good: Callable[[Path, str], bool],
        fetch: Callable[[Path, str], None],
    ) -> None:
        if digest not in self._verified or not path.exists():
            if not is_good(path, digest):
                fetch(path, digest)
            self._verified.add(digest)
        if not self._paths.shared:
            os.utime(path)  # the caches forget what was not used for longest

    def _is_scene(self, path: Path, digest: str) -> bool:
        """Whether the scene lies here undamaged; one of the daemon's own cannot be mended."""
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return False
        try:
            good = codec.from_json(Scene, data).digest == digest
        except ValueError:
            good = False
        if not good and self._paths.shared:
            raise ValueError(f"{path} is damaged: remove it and submit its campaign again")
        return good

    def _fetch_scene(self, path: Path, digest: str) -> None:
        scene = self._daemon.ask(SCENE, IdRequest(digest))
        if scene.digest != digest:
            raise ValueError(f"the daemon sent {scene.digest[:12]} for the scene {digest[:12]}")
        write_atomically(path, codec.to_json(scene))
        if not self._paths.shared:
            trim_cache(path.parent.glob("*.json"), _MOST_SCENES, lambda _: 1, _SCENE_IN_USE)

    def _fetch_file(self, path: Path, digest: str) -> None:
        if self._paths.shared:
            raise ValueError(f"{path} is gone or damaged: submit its campaign again")
        path.parent.mkdir(mode=0o700, exist_ok=True)
        part = path.with_name(f".{digest}.{os.getpid()}.part")
        part.unlink(missing_ok=True)
        try:
            download(
                part,
                lambda offset: self._daemon.ask(FILE, FileDownloadRequest(digest, offset)),
                largest=LARGEST_FILE,
                progress=lambda _: self._meanwhile(),
            )
            if file_sha256(part) != digest:
                raise ValueError(f"the daemon sent another file for {digest[:12]}")
            # Read only: the system under test of one run must not change it for the next.
            part.chmod(0o400)
            move_durably(part, path)
        finally:
            part.unlink(missing_ok=True)
        trim_cache(path.parent.iterdir(), _LARGEST_FILE_CACHE, lambda s: s.st_size, _FILE_IN_USE)


def _is_file(path: Path, digest: str) -> bool:
    return path.exists() and file_sha256(path) == digest
