"""The daemon's scenes and files as runs need them: what is gone or damaged is offered to nobody.

A run whose scene is not there is not leased: it waits, with that as its reason, until somebody
brings the scene, by submitting its campaign again say.
"""

from __future__ import annotations

import threading
from pathlib import Path

from daemon.batch.inputs import is_intact
from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog
from daemon.model.ids import is_digest
from daemon.model.spec import RunSpec


class InputStore:
    """The scenes and files of the state directory; used by all threads of the daemon."""

    def __init__(self, paths: StatePaths, log: EventLog) -> None:
        self._paths = paths
        self._log = log
        self._lock = threading.Lock()
        self._missing: dict[Path, str] = {}

    def missing(self, spec: RunSpec) -> str:
        """What a run lacks here, in words for people; empty when all is there."""
        files = (self._paths.files / digest for digest in spec.files if is_digest(digest))
        paths = [self._paths.scene(spec.scene), *files]
        absent = next((path for path in paths if not path.exists()), None)
        if absent is None:
            return ""
        with self._lock:
            if absent not in self._missing:
                self._missing[absent] = _words(absent)
                self._log.write("input missing", path=str(absent))
            return self._missing[absent]

    def take_restored(self) -> tuple[str, ...]:
        """The reasons why runs waited that are none any more; each once."""
        if not self._missing:
            return ()
        with self._lock:
            restored = {path: words for path, words in self._missing.items() if path.exists()}
            for path in restored:
                del self._missing[path]
        return tuple(restored.values())

    def examine(self, digest: str) -> None:
        """Look whether the scene or file is what its name says; put it aside if it is not."""
        if not is_digest(digest):
            return
        for path in (self._paths.scene(digest), self._paths.files / digest):
            if path.exists() and not is_intact(path):
                aside = self._paths.put_aside(path)
                self._log.write("input damaged", path=str(path), aside=str(aside))


def _words(path: Path) -> str:
    what = "scene" if path.suffix else "file"
    return f"the {what} {path.stem[:12]} is gone or was damaged: submit its campaign again"
