"""What the first run on a machine compiles: CPU seconds of each kernel, from an empty cache.

A kernel's own time is without that of the kernels it calls. The ratio is to what loading the same
from the disk takes, in a second process.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time

from numba.core import event

from daemon.model.kernel_rooms import kernel_rooms
from daemon.run import warm_up

SYSTEMS = {
    "pilot": ("pilot", {}),
    "ros": ("ros", {"move_base": {"base_local_planner": "dwa_local_planner/DWAPlannerROS"}}),
}
SHOWN = 12


class _Times(event.Listener):
    """CPU seconds of each function that is compiled, by name."""

    def __init__(self) -> None:
        self.own: dict[str, float] = {}
        self._open: list[list[float]] = []

    def on_start(self, _: event.Event) -> None:
        self._open.append([time.process_time(), 0.0])

    def on_end(self, happened: event.Event) -> None:
        begun, inner = self._open.pop()
        took = time.process_time() - begun
        if self._open:
            self._open[-1][1] += took
        function = happened.data["dispatcher"].py_func
        name = f"{function.__module__}.{function.__name__}"
        self.own[name] = self.own.get(name, 0.0) + took - inner


def measure(system: str) -> None:
    """Load what a run of ``system`` needs, in a process of its own; print what that took."""
    times = _Times()
    begun = time.process_time()
    with event.install_listener("numba:compile", times):
        warm_up(kernel_rooms(*SYSTEMS[system]))
    print(f"{time.process_time() - begun:.3f}")
    for name, took in sorted(times.own.items(), key=lambda item: -item[1])[:SHOWN]:
        print(f"  {name.removeprefix('daemon.'):60} {took:.2f} s")


def main() -> None:
    """One cold and one warm process for each system."""
    program = f"import sys; from {__name__} import measure; measure(sys.argv[1])"
    for system in SYSTEMS:
        with tempfile.TemporaryDirectory(prefix="bench-first-run-") as folder:
            environment = os.environ | {"NUMBA_CACHE_DIR": folder}
            cold, warm = (
                subprocess.run(
                    [sys.executable, "-c", program, system],
                    env=environment, capture_output=True, text=True, check=True,
                ).stdout.splitlines()
                for _ in range(2)
            )  # fmt: skip
        print(f"{f'CPU before the first run, {system}':62} {float(cold[0]):.1f} s")
        print(f"{'  ratio to loading it from the disk':62} {float(cold[0]) / float(warm[0]):.1f}")
        print("\n".join(cold[1:]))
