"""What the first run on a machine compiles: CPU seconds of all kernels and of the slowest, from an
empty cache.

A kernel's own time is without that of the kernels it calls. The reference is what loading the same
from the disk takes, in a second process.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from numba.core import event

from daemon.model.kernel_rooms import kernel_rooms
from daemon.run import warm_up
from tests.benchmarks import progress
from tests.benchmarks.measurement import Measurement, Reference

SYSTEMS = {
    "pilot": ("pilot", {}),
    "ros": ("ros", {"move_base": {"base_local_planner": "dwa_local_planner/DWAPlannerROS"}}),
}
SHOWN = 8
ROOT = Path(__file__).parents[2]


class _Times(event.Listener):
    """CPU seconds of each function that is compiled, by name."""

    def __init__(self):
        self.own = {}
        self._open = []

    def on_start(self, _):
        self._open.append([time.process_time(), 0.0])

    def on_end(self, happened):
        begun, inner = self._open.pop()
        took = time.process_time() - begun
        if self._open:
            self._open[-1][1] += took
        function = happened.data["dispatcher"].py_func
        name = f"{function.__module__}.{function.__name__}"
        self.own[name] = self.own.get(name, 0.0) + took - inner


def tell(system):
    """Load what a run of ``system`` needs; print as JSON what that took, and each compilation."""
    times = _Times()
    begun = time.process_time()
    with event.install_listener("numba:compile", times):
        warm_up(kernel_rooms(*SYSTEMS[system]))
    print(json.dumps((time.process_time() - begun, times.own)))


def told(system, folder):
    """What :func:`tell` says of a process of its own, with machine code in ``folder``."""
    said = subprocess.run(
        [sys.executable, "-c", f"from {__name__} import tell; tell({system!r})"],
        cwd=ROOT, env=os.environ | {"NUMBA_CACHE_DIR": folder},
        stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    took, own = json.loads(said.stdout)
    return took, own


def measure():
    """One cold and one warm process for each system."""
    for system in SYSTEMS:
        with tempfile.TemporaryDirectory(prefix="bench-first-run-") as folder:
            progress.say(f"{system}: compiling everything")
            cold, own = told(system, folder)
            progress.say(f"{system}: loading it")
            warm, _ = told(system, folder)
        yield Measurement(
            f"kernels of {system}, compiled", cold, "CPU s", Reference("loaded", warm),
            note=f"{len(own)} functions",
        )  # fmt: skip
        for name in sorted(own, key=own.__getitem__, reverse=True)[:SHOWN]:
            yield Measurement(
                f"  {'.'.join(name.split('.')[-2:])}", own[name], "CPU s", Reference("all", cold)
            )
