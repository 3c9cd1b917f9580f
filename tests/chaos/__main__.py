"""Long campaigns of violence: ``make chaos``, or ``python -m tests.chaos violence --runs 500``.

Each scenario prints what it did and saw, in the end a table says what all of them came to; the exit
code is 1 when something that must hold did not.
"""

import argparse
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path

from daemon.batch.errors import DaemonError
from tests.chaos.clock import clock
from tests.chaos.disk import full_disk
from tests.chaos.network import network
from tests.chaos.output import output
from tests.chaos.plugins import plugins
from tests.chaos.report import Report, table
from tests.chaos.stacks import stacks
from tests.chaos.storm import storm
from tests.chaos.torn import torn
from tests.chaos.violence import violence


def _scenarios(options):
    seed, strength = options.seed, {"kills": options.kills, "operators": options.operators}
    return {
        "violence": lambda folder: violence(folder, runs=options.runs, seed=seed, **strength),
        "disk": full_disk,
        "torn": lambda folder: torn(folder, seed=seed),
        "clock": lambda folder: clock(folder, seed=seed),
        "stacks": lambda folder: stacks(folder, seed=seed),
        "network": network,
        "storm": lambda folder: storm(folder, seed=seed),
        "plugins": plugins,
        "output": output,
    }


def _perform(name, act, folder):
    """A scenario that waits for something in vain has found a violation, too."""
    start = time.monotonic()
    try:
        return act(folder)
    except (AssertionError, DaemonError):
        report = Report(name, start)
        report.violations.append(traceback.format_exc())
        return report


def main():
    """Run the chosen scenarios, or all; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.chaos", description=__doc__)
    parser.add_argument("scenario", nargs="*", help="some by name; default: all")
    parser.add_argument("--runs", type=int, default=2000, help="runs of the scenario violence")
    parser.add_argument("--kills", type=int, default=0, help="of violence, evenly, of empty runs")
    parser.add_argument("--operators", type=int, default=2, help="who steer during violence")
    parser.add_argument("--seed", type=int, default=1, help="what is struck, and when")
    options = parser.parse_args()
    known = _scenarios(options)
    unknown = [name for name in options.scenario if name not in known]
    if unknown:
        parser.error(f"no scenario {', '.join(unknown)}; there are: {', '.join(known)}")
    # Told to stop, it still ends what it has started.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    violated = False
    rows = []
    for name, act in known.items():
        if options.scenario and name not in options.scenario:
            continue
        with tempfile.TemporaryDirectory(prefix=f"chaos-{name}-") as folder:
            report = _perform(name, act, Path(folder))
            report.end()
        print(report.text(), flush=True)
        violated = violated or bool(report.violations)
        rows += report.rows
    print(f"\n{table(rows)}", flush=True)
    return int(violated)


if __name__ == "__main__":
    sys.exit(main())
