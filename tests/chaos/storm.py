"""All at once: bad lines, cuts, chatty runs, trees, large traces, and a daemon that is killed."""

import random
import time
from contextlib import ExitStack

from tests.chaos.executor import EXECUTOR, Executions
from tests.chaos.links import links, may_make_namespaces, relay
from tests.chaos.network import worker_at
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.chaos.violence import progress
from tests.make import make_spec, submission_of
from tests.parts import daemon_at, eventually, finished, free_endpoint

CUTS = (1.0, 3.0, 6.0)
"""Seconds, all shorter than the lease."""


def storm(folder, *, runs=200, seed=1, lease=30.0, every=8.0, seconds=120.0):
    """Kill the daemon and cut lines, none for as long as a lease: no run is started over.

    No worker and no run is killed here, so that whatever is begun twice was healthy.
    """
    report = Report("storm: bad lines, cuts, chatty runs and daemon restarts at once")
    rng = random.Random(seed)
    log = Executions(folder / "executions")
    specs = [
        make_spec(
            i,
            sleep=round(rng.uniform(0.2, 4.0), 2),
            ballast=rng.choice((2_000, 50_000, 400_000)),
            chatter=rng.choice((0, 1_000, 500_000)),
            log=str(log.path),
        )
        for i in range(runs)
    ]
    struck = {"daemon killed": 0, "line cut": 0}
    with ExitStack() as stack:
        isolated = may_make_namespaces()
        endpoint, cables = stack.enter_context(links(free_endpoint(), 2, isolated=isolated))
        daemon = stack.enter_context(
            daemon_at(folder / "state", 1, listen=endpoint, lease=lease, executor=EXECUTOR)
        )
        daemon.client().close()
        loses = isolated and cables[1].drop_packets(0.1)
        report.fact("a line loses packets", loses)
        far = stack.enter_context(relay(endpoint, delay=0.1))
        slow = stack.enter_context(relay(endpoint, rate=200_000))
        lines = [*cables, far, slow]
        for number, line in enumerate(lines):
            stack.enter_context(worker_at(daemon, line, 2, folder / f"away-{number}"))
            stack.callback(line.mend)
        with daemon.client() as client:
            # A worker that finds no daemon when it begins leaves, and nobody starts it again.
            eventually(lambda: len(client.workers()) == 1 + len(lines), 120.0)
            client.submit(submission_of("storm", *specs))
        end = time.monotonic() + seconds
        while time.monotonic() < end and progress(daemon.endpoint) != (runs, 0):
            if rng.random() < 0.4:
                daemon.kill()
                time.sleep(rng.uniform(0.0, 2.0))
                daemon.restart()
                struck["daemon killed"] += 1
            else:
                line = rng.choice(lines)
                line.cut()
                time.sleep(rng.choice(CUTS))
                line.mend()
                struck["line cut"] += 1
            time.sleep(rng.uniform(0.0, every))
        with daemon.client() as client:
            eventually(lambda: finished(client, runs), 300.0)
        for what, times in struck.items():
            report.fact(what, times)
        report.expect_none_started_over(log)
        verify(report, daemon.state, runs)
    return report
