"""Judging a run while somebody watches it, as often as the clock on the wall allows.

Nothing of this has any influence on the run: what is recorded is read, never written.
"""

from __future__ import annotations

import random
import time
import traceback
from contextlib import suppress
from dataclasses import replace
from typing import Final, Literal, Protocol

import numpy as np

from daemon.judging.live import judge_running, least_margin
from daemon.judging.oracles import judge_so_far
from daemon.model.deadline import OutOfTime, interruptible
from daemon.model.live_judgement import LiveJudgement, LogLine
from daemon.model.spec import Snapshot
from daemon.model.verdicts import Verdict
from daemon.run_loop import ProgressCallback
from daemon.trace import TraceWriter
from grammars.text.terminal_text import printable

JudgingWanted = Literal["nothing", "margin", "everything"]

_PERIOD: Final = 1.0
"""Seconds of the wall's clock between two judgements, at least; for a margin alone twice that."""
_SHARE: Final = 0.1
"""Share of the run's time that judging takes in the long run, at most; half of it for a margin."""
_LONGEST_REASON: Final = 200


class JudgementReceiver(Protocol):
    """Receiver of the judgements of a watched run."""

    def wanted(self) -> JudgingWanted:
        """Say what is wanted right now; asked with every snapshot."""

    def tell(self, judgement: LiveJudgement) -> None:
        """Take a judgement; must not wait for anybody."""


class WatchedRun:
    """Passes the snapshots of a run on, with its least margin; judges the run in between."""

    def __init__(
        self, trace: TraceWriter, on_progress: ProgressCallback, receiver: JudgementReceiver
    ) -> None:
        self._trace, self._on_progress, self._receiver = trace, on_progress, receiver
        self._failed = False
        self._now = 0.0
        # When the next judgement of a kind may begin; none is due later that was never made.
        self._due: dict[JudgingWanted, float] = {}
        self._told: LiveJudgement | None = None
        self._wanted: JudgingWanted = "nothing"
        self._least: Verdict | None = None

    def __call__(self, snapshot: Snapshot) -> None:
        """Take a snapshot of the run."""
        wanted = self._receiver.wanted()
        if wanted == "nothing" or self._failed:
            self._least = None
        if self._least is not None:
            least = self._least
            snapshot = replace(snapshot, margin=least.margin, unit=least.unit, oracle=least.oracle)
        # First what is seen, then what is made of it: that may take longer.
        self._on_progress(snapshot)
        began, self._wanted = wanted != self._wanted, wanted
        self._now = snapshot.time
        now = time.perf_counter()
        if wanted != "nothing" and not self._failed and now >= self._due.get(wanted, now):
            self._look_in_turn(wanted, now)
        elif began and wanted == "everything" and self._told is not None:
            # Who opens a run before earlier judgements are paid for sees the last one.
            self._tell(self._told)

    def _look_in_turn(self, wanted: JudgingWanted, now: float) -> None:
        # The first of a kind loads what it needs and reads what is recorded so far: that comes
        # once, and says nothing of how long the next one takes.
        first = wanted not in self._due
        self._look(wanted)
        took = 0.0 if first else time.perf_counter() - now
        rest = max(_PERIOD, took / _SHARE)
        self._due["margin"] = now + 2.0 * rest
        if wanted == "everything":
            self._due[wanted] = now + rest

    def finish(self, ended: str, note: str) -> None:
        """Tell the last judgement, that of the run as it ended, if anybody still watches."""
        if self._wanted == "everything":
            self._look("everything", ended, note)

    def _look(self, wanted: JudgingWanted, ended: str | None = None, note: str = "") -> None:
        if self._failed:
            return
        # Drawn from by oracles that plug in, and by systems under test that do.
        chance = random.getstate(), np.random.get_state()
        try:
            with interruptible("the judging of a run that is watched"):
                trace = self._trace.so_far(ended, note)
                judgement = judge_running(trace) if wanted == "everything" else None
                found = judgement.verdicts if judgement else judge_so_far(trace, trace.spec.oracles)
                self._least = least_margin(found)
        except (Exception, OutOfTime) as error:
            # Whatever it is, the run goes on; at its end the same is judged, and told, once more.
            self._give_up(error, wanted)
            return
        finally:
            random.setstate(chance[0])
            np.random.set_state(chance[1])
        if judgement is not None:
            self._tell(judgement)

    def _tell(self, judgement: LiveJudgement) -> None:
        try:
            self._receiver.tell(judgement)
        except Exception as error:  # what a plug-in says may be nothing that can be written down
            self._give_up(error, "everything")
        else:
            self._told = judgement

    def _give_up(self, error: BaseException, wanted: JudgingWanted) -> None:
        """Judge no more, and say so to who watches: what was told last no longer holds."""
        traceback.print_exception(error)
        self._failed = True
        words = printable(f"not judged any more while it runs: {_name(error)}"[:_LONGEST_REASON])
        line = LogLine(self._now, "oracles", words, "error")
        # Told again whenever somebody opens the run.
        self._told = LiveJudgement("", self._now, (), (), (), (), (line,))
        if wanted == "everything":
            with suppress(Exception):  # the way there may be what has failed
                self._receiver.tell(self._told)


def _name(error: BaseException) -> str:
    """Return what an error is called, of whatever class of a plug-in it is."""
    try:
        return repr(error)
    except Exception:
        return type(error).__name__
