"""The kernels that the first run on a machine compiles: seconds of all and of the slowest.

The short run begins with an empty folder of machine code; a second process that loads the same is
the reference. A kernel's own time is without that of the kernels it calls, and without those that
another process compiles meanwhile.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from numba.core import event

from daemon.campaign import expand, load_campaign
from daemon.run import load_kernels
from tests.benchmarks import progress
from tests.benchmarks.measurement import Measurement, Reference

SYSTEMS = {"pilot": "demo", "a2s": "ortega2024"}
"""Systems under test, each in the first run of a campaign."""
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
    campaign = ROOT / "campaigns" / SYSTEMS[system] / "campaign.yaml"
    submission = expand(load_campaign(campaign))
    spec = next(spec for spec in submission.specs if spec.sut.name == system)
    scene = next(scene for scene in submission.scenes if scene.digest == spec.scene)
    times = _Times()
    begun = time.perf_counter()
    with event.install_listener("numba:compile", times):
        load_kernels(spec, scene)
    print(json.dumps((time.perf_counter() - begun, times.own)))


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
            f"kernels of {system}, compiled", cold, "s", Reference("loaded", warm),
            note=f"{len(own)} functions here",
        )  # fmt: skip
        for name in sorted(own, key=own.__getitem__, reverse=True)[:SHOWN]:
            yield Measurement(
                f"  {'.'.join(name.split('.')[-2:])}",
                own[name],
                "CPU s",
                Reference("all", sum(own.values())),
            )
