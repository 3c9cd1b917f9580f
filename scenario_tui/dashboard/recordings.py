"""Recordings of finished runs: fetched to this machine, read by the child process, cached."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

from daemon.batch.errors import DaemonError

if TYPE_CHECKING:
    from daemon.model.status import RunRow
    from daemon.model.verbs import ClientOpener
    from daemon.model.verdicts import Verdict
    from scenario_tui.dashboard.children import Children
    from scenario_tui.dashboard.playback import Playback

_KEPT: Final = 4
"""Recordings to keep: a run, one to compare it with, and those the cursor has just left."""

_Key: TypeAlias = "tuple[str, str, tuple[Verdict, ...]]"
"""The digest and the place of a trace, and its verdicts.

The place alone is no key: a run that is executed again writes the same file.
"""


@dataclass(frozen=True, slots=True)
class Missing:
    """The reason why a run has no recording, or not yet; empty during the short time of reading."""

    why: str = ""


class Recordings:
    """Reads recordings, and keeps the last ones.

    ``connect`` opens a connection to the daemon, which sends traces of other machines. Another
    thread calls ``on_read`` when one more recording is ready or missing.
    """

    def __init__(self, connect: ClientOpener, children: Children) -> None:
        self._connect, self._children = connect, children
        self.on_read: Callable[[], object] = bool
        self._recordings: dict[_Key, Playback | Missing] = {}
        self._under_way: set[_Key] = set()
        self._front: _Key | None = None
        self._changing, self._reading = threading.Lock(), threading.Lock()

    def get(self, row: RunRow) -> Playback | Missing:
        """Return the recording of a finished run if it is ready; otherwise start to read it.

        For the thread that draws: the run of the last call is the one in front.
        """
        if why := _why_never(row):
            return Missing(why)
        key = _key(row)
        if key != self._front:
            self.look_again()  # a user who comes back to a missing recording tries again
            self._front = key
        if (recording := self._find(key)) is not None:
            return recording
        if key not in self._under_way:
            self._under_way.add(key)
            # A thread for each: a large trace over a slow line must not keep the next run waiting.
            fetch = partial(self._fetch, key, row)
            threading.Thread(target=fetch, name="recording", daemon=True).start()
        megabytes = row.result.trace.size / 1e6 if row.result is not None else 0.0
        here = Path(row.trace).is_file()
        return Missing("" if here else f"Fetching its trace, {megabytes:.1f} MB …")

    def read(self, row: RunRow) -> Playback | Missing:
        """Return the recording of a run; not for the thread that draws, because it may be slow."""
        if why := _why_never(row):
            return Missing(why)
        if (recording := self._find(_key(row))) is not None:
            return recording
        return self._play(self._bring(row), row)

    def look_again(self) -> None:
        """Forget missing recordings, so that the next call tries to read them again."""
        with self._changing:
            items = self._recordings.items()
            self._recordings = {key: one for key, one in items if not isinstance(one, Missing)}

    def _find(self, key: _Key) -> Playback | Missing | None:
        with self._changing:
            recording = self._recordings.pop(key, None)
            if recording is not None:
                self._recordings[key] = recording  # the last one is the one used last
            return recording

    def _fetch(self, key: _Key, row: RunRow) -> None:
        path = self._bring(row)
        with self._reading:
            # Skip a run that the cursor has left already.
            recording = self._play(path, row) if key == self._front else None
        with self._changing:
            self._under_way.discard(key)
            if recording is not None:
                self._recordings[key] = recording
                while len(self._recordings) > _KEPT:
                    del self._recordings[next(iter(self._recordings))]
        self.on_read()

    def _bring(self, row: RunRow) -> Path | Missing:
        """Return the path of a trace on this machine, after fetching it if necessary."""
        from daemon.batch.stores import is_url, local_copy, matches_digest, trace_reference

        trace, here = trace_reference(row), Path(row.trace)
        if not is_url(row.trace) and matches_digest(here, trace.size, trace.sha256):
            return here
        try:
            with self._connect() as daemon:
                return local_copy(trace, daemon)
        except DaemonError as error:
            # A damaged file is shown as far as it can be read.
            if here.is_file():
                return here
            problem = f"Its trace is not on this machine, and cannot be fetched: {error}"
            return Missing(
                f"{problem}\n\nLook at it on the machine of its worker, or run it again."
            )

    def _play(self, path: Path | Missing, row: RunRow) -> Playback | Missing:
        if isinstance(path, Missing):
            return path
        # Imported here, because readers of traces load slowly and the dashboard must start fast.
        from daemon.trace import TraceError
        from scenario_tui.dashboard.playback import read_playback

        try:
            return self._children.run(read_playback, path, row.verdicts)
        except TraceError as error:
            problem = "; ".join(finding.message for finding in error.findings)
            hint = "Run it again, or copy the file anew from the machine of its worker."
            return Missing(f"Its trace cannot be used: {problem}: {path}\n\n{hint}")
        except DaemonError as error:
            return Missing(f"Its trace could not be read: {error}\n\nOpen the run again.")


def _key(row: RunRow) -> _Key:
    assert row.result is not None
    return row.result.trace.sha256, row.trace, row.verdicts


def _why_never(row: RunRow) -> str:
    """Return why a run in its present state has no recording; empty if it may have one."""
    if not row.settled:
        return f"This run is {row.state}: its trace exists when it ends."
    if row.result is None:
        return f"This run was {row.state}: it has no recording.\n\nr queues it again."
    return "" if row.trace else "No trace of this run was kept."
