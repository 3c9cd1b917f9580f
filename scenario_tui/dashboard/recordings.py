"""Recordings of runs that are over: brought to this machine, read by the child process, kept."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
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
"""Recordings kept: a run, one to compare it with, and those the cursor has just left."""

_Key: TypeAlias = "tuple[str, str, tuple[Verdict, ...]]"
"""The digest and the place of a trace, and the verdicts shown with it."""


@dataclass(frozen=True, slots=True)
class Missing:
    """The reason, for people, why there is no recording of a run to look at, or not yet.

    It is empty while one is read, which takes no time worth telling.
    """

    why: str = ""


class Recordings:
    """Reads recordings, and keeps the last ones.

    ``connect`` opens a connection to the daemon, which sends traces of other machines. Set
    ``on_read`` to be called, by another thread, when one more recording is known or missing.
    """

    # The path of a trace identifies nothing: a run that is executed again writes the same file.

    def __init__(self, connect: ClientOpener, children: Children) -> None:
        self._connect, self._children = connect, children
        self.on_read: Callable[[], object] = bool
        self._known: dict[_Key, Playback | Missing] = {}
        self._under_way: set[_Key] = set()
        self._untold = 0
        self._wanted: _Key | None = None
        self._changing, self._reading = threading.Lock(), threading.Lock()

    @property
    def busy(self) -> bool:
        """True while a recording is brought or read, until ``on_read`` has returned."""
        return self._untold > 0

    def get(self, row: RunRow) -> Playback | Missing:
        """Return the recording of a run that is over, as far as it is known.

        Otherwise it is read meanwhile. For the thread that draws: the last run asked for is the
        one that is shown.
        """
        if why := _why_never(row):
            return Missing(why)
        key = _key(row)
        if key != self._wanted:
            self.look_again()  # whoever comes back to what is missing looks again
            self._wanted = key
        if (known := self._find(key)) is not None:
            return known
        if key not in self._under_way:
            self._under_way.add(key)
            with self._changing:
                self._untold += 1
            # A thread for each: a large trace over a slow line must not keep the next run waiting.
            threading.Thread(target=self._fetch, args=(key, row), daemon=True).start()
        megabytes = row.result.trace.size / 1e6 if row.result is not None else 0.0
        here = Path(row.trace).is_file()
        return Missing("" if here else f"Bringing its trace here, {megabytes:.1f} MB …")

    def read(self, row: RunRow) -> Playback | Missing:
        """Return the recording of a run; any thread but that which draws, for it may take long."""
        if why := _why_never(row):
            return Missing(why)
        if (known := self._find(_key(row))) is not None:
            return known
        return self._play(self._bring(row), row)

    def look_again(self) -> None:
        """Try once more to read what is missing: somebody looks again."""
        with self._changing:
            known = self._known.items()
            self._known = {key: one for key, one in known if not isinstance(one, Missing)}

    def _find(self, key: _Key) -> Playback | Missing | None:
        with self._changing:
            known = self._known.pop(key, None)
            if known is not None:
                self._known[key] = known  # the last one is the one used last
            return known

    def _fetch(self, key: _Key, row: RunRow) -> None:
        path = self._bring(row)
        with self._reading:
            # Nobody looks any more at the run that a cursor went past.
            known = self._play(path, row) if key == self._wanted else None
        with self._changing:
            self._under_way.discard(key)
            if known is not None:
                self._known[key] = known
                while len(self._known) > _KEPT:
                    del self._known[next(iter(self._known))]
        self.on_read()
        with self._changing:
            self._untold -= 1

    def _bring(self, row: RunRow) -> Path | Missing:
        """Return where a trace lies on this machine, after bringing it here if need be."""
        from daemon.batch.stores import is_url, local_copy, matches_digest, trace_reference

        trace, here = trace_reference(row), Path(row.trace)
        if not is_url(row.trace) and matches_digest(here, trace.size, trace.sha256):
            return here
        try:
            with self._connect() as daemon:
                return local_copy(trace, daemon)
        except DaemonError as error:
            # Of a file that is damaged, what can be read is shown all the same.
            if here.is_file():
                return here
            what = f"Its trace is not on this machine, and cannot be brought here: {error}"
            return Missing(f"{what}\n\nLook at it where its worker is, or run it again.")

    def _play(self, path: Path | Missing, row: RunRow) -> Playback | Missing:
        if isinstance(path, Missing):
            return path
        # What reads traces takes a while to load, and the dashboard is to be there at once.
        from daemon.trace import TraceError
        from scenario_tui.dashboard.playback import read_playback

        try:
            return self._children.run(read_playback, path, row.verdicts)
        except TraceError as error:
            what = "; ".join(finding.message for finding in error.findings)
            hint = "Run it again, or copy the file anew from where its worker is."
            return Missing(f"Its trace cannot be used: {what}: {path}\n\n{hint}")
        except DaemonError as error:
            return Missing(f"Its trace could not be read: {error}\n\nOpen the run again.")


def _key(row: RunRow) -> _Key:
    assert row.result is not None
    return row.result.trace.sha256, row.trace, row.verdicts


def _why_never(row: RunRow) -> str:
    """Return why there cannot be a recording of a run as it stands, empty if there can."""
    if not row.settled:
        return f"This run is {row.state}: its trace is there when it is over."
    if row.result is None:
        return f"This run was {row.state}: there is nothing to look at.\n\nr queues it again."
    return "" if row.trace else "No trace of this run was kept."
