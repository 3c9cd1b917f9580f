"""Judging a run while somebody watches it, as often as the wall clock allows.

It never influences the run: it reads the recording and writes nothing.
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

JudgingScope = Literal["nothing", "margin", "everything"]

_PERIOD: Final = 1.0
"""Least time between two judgements [s, wall clock]; twice that for a margin alone."""
_SHARE: Final = 0.1
"""Largest long-term share of the run's time for judging; half of it for a margin alone."""
_LONGEST_REASON: Final = 200


class JudgementReceiver(Protocol):
    """Receiver of the judgements of a watched run."""

    def scope(self) -> JudgingScope:
        """Return the part of a judgement to make now; called with every snapshot."""

    def tell(self, judgement: LiveJudgement) -> None:
        """Take a judgement, without waiting."""


class WatchedRun:
    """Forwards the snapshots of a run with its least margin; judges the run in between."""

    def __init__(
        self, trace: TraceWriter, on_progress: ProgressCallback, receiver: JudgementReceiver
    ) -> None:
        self._trace, self._on_progress, self._receiver = trace, on_progress, receiver
        self._failed = False
        self._now = 0.0
        # Earliest time of the next judgement of a scope; a scope never judged is due at once.
        self._due: dict[JudgingScope, float] = {}
        self._latest: LiveJudgement | None = None
        self._scope: JudgingScope = "nothing"
        self._least: Verdict | None = None

    def __call__(self, snapshot: Snapshot) -> None:
        """Take a snapshot of the run."""
        scope = self._receiver.scope()
        if scope == "nothing" or self._failed:
            self._least = None
        if self._least is not None:
            least = self._least
            snapshot = replace(snapshot, margin=least.margin, unit=least.unit, oracle=least.oracle)
        # The snapshot first: judging may take longer.
        self._on_progress(snapshot)
        began, self._scope = scope != self._scope, scope
        self._now = snapshot.time
        now = time.perf_counter()
        if scope != "nothing" and not self._failed and now >= self._due.get(scope, now):
            self._look_in_turn(scope, now)
        elif began and scope == "everything" and self._latest is not None:
            # A watcher who comes while judging still rests sees the last judgement.
            self._tell(self._latest)

    def _look_in_turn(self, scope: JudgingScope, now: float) -> None:
        # The first judgement of a scope also loads code and reads the whole recording, so its
        # duration does not predict that of the next one.
        first = scope not in self._due
        self._look(scope)
        took = 0.0 if first else time.perf_counter() - now
        rest = max(_PERIOD, took / _SHARE)
        self._due["margin"] = now + 2.0 * rest
        if scope == "everything":
            self._due[scope] = now + rest

    def finish(self, ended: str, note: str) -> None:
        """Send the last judgement, of the complete run, to anybody who still watches."""
        if self._scope == "everything":
            self._look("everything", ended, note)

    def _look(self, scope: JudgingScope, ended: str | None = None, note: str = "") -> None:
        if self._failed:
            return
        # Oracles that are plug-ins, and some systems under test, draw random numbers.
        chance = random.getstate(), np.random.get_state()
        try:
            with interruptible("the judging of a run that is watched"):
                trace = self._trace.so_far(ended, note)
                judgement = judge_running(trace) if scope == "everything" else None
                self._least = least_margin(
                    judgement.verdicts if judgement else judge_so_far(trace, trace.spec.oracles)
                )
        except (Exception, OutOfTime) as error:
            # The run goes on; the judgement at its end reports the error again.
            self._give_up(error, scope)
            return
        finally:
            random.setstate(chance[0])
            np.random.set_state(chance[1])
        if judgement is not None:
            self._tell(judgement)

    def _tell(self, judgement: LiveJudgement) -> None:
        try:
            self._receiver.tell(judgement)
        except Exception as error:  # a plug-in's text may not be serialisable
            self._give_up(error, "everything")
        else:
            self._latest = judgement

    def _give_up(self, error: BaseException, scope: JudgingScope) -> None:
        """Stop judging and tell the watchers: the latest judgement no longer holds."""
        traceback.print_exception(error)
        self._failed = True
        words = printable(f"not judged any more while it runs: {_name(error)}"[:_LONGEST_REASON])
        line = LogLine(self._now, "oracles", words, "error")
        # Sent again to each new watcher.
        self._latest = LiveJudgement("", self._now, (), (), (), (), (line,))
        if scope == "everything":
            with suppress(Exception):  # the receiver itself may have failed
                self._receiver.tell(self._latest)


def _name(error: BaseException) -> str:
    """Return the text of an error, or its class if a plug-in's class has no text."""
    try:
        return repr(error)
    except Exception:
        return type(error).__name__
