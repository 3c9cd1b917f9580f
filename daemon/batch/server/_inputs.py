"""The daemon's scenes and files as runs need them: what is gone or damaged is offered to nobody.

A run whose scene is not there is not leased: it waits, with that as its reason, until somebody
brings the scene, by submitting its campaign again say.
"""

from __future__ import annotations

from daemon.batch.paths import StatePaths
from daemon.batch.server._runtime import EventLog
from daemon.batch.stores import is_intact
from daemon.model.ids import is_digest
from daemon.model.spec import RunSpec


class InputStore:
    """The scenes and files of the state directory; used by all threads of the daemon."""

    def __init__(self, paths: StatePaths, log: EventLog) -> None:
        self._paths = paths
        self._log = log

    def missing(self, spec: RunSpec) -> str:
        """What a run lacks here, as ``scene`` or ``file`` and a digest; empty when all is there."""
        files = (self._paths.files / digest for digest in spec.files if is_digest(digest))
        paths = [self._paths.scene(spec.scene), *files]
        absent = next((path for path in paths if not path.exists()), None)
        if absent is None:
            return ""
        self._log.write("input missing", path=str(absent))
        return f"{'scene' if absent.suffix else 'file'} {absent.stem}"

    def has(self, lacked: str) -> bool:
        """Whether what runs lacked, as :meth:`missing` says it, is here."""
        kind, _, digest = lacked.partition(" ")
        path = self._paths.scene(digest) if kind == "scene" else self._paths.files / digest
        return path.exists()

    def examine(self, digest: str) -> None:
        """Look whether the scene or file is what its name says; put it aside if it is not."""
        if not is_digest(digest):
            return
        for path in (self._paths.scene(digest), self._paths.files / digest):
            if path.exists() and not is_intact(path):
                aside = self._paths.put_aside(path)
                self._log.write("input damaged", path=str(path), aside=str(aside))
