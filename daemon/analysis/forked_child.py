"""Preparation of a forked process that executes one run again."""

from __future__ import annotations

import gc
import os
import signal
import sys
from typing import Final

import numpy as np

from daemon.supervision.child import lower_session
from daemon.supervision.guardian import guard

_NICENESS: Final = 10


def prepare_child() -> None:
    """Make this child a place for one run: guarded, in the background, silent, its own chance.

    To be called by a child of :mod:`multiprocessing`, before it has started anything.
    """
    os.setsid()
    lower_session(_NICENESS)
    guard()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent tells when to end
    os.setpriority(os.PRIO_PROCESS, 0, max(_NICENESS, os.getpriority(os.PRIO_PROCESS, 0)))
    # By descriptors too: what a system under test starts prints to those.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for descriptor in (1, 2):
        os.dup2(nowhere, descriptor)
    sys.stdout = sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123
    # Python seeds its own generator anew in a child. numpy does not: two children would draw the
    # same numbers from a generator that nobody has seeded, and look deterministic.
    np.random.seed()
    # A run collects garbage when it ends: only its own, not through all that the parent has loaded.
    gc.freeze()
