"""A worker is cut off for longer than its lease, finishes its run meanwhile, and comes back."""

import sqlite3
import time
from contextlib import ExitStack, closing

from grammars.text.files import matching_paths
from tests.chaos.links import links, may_make_namespaces
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.make import make_submission
from tests.parts import (
    daemon_at,
    eventually,
    finished,
    free_endpoint,
    worker_for,
)

EXECUTOR = "tests.chaos.executor:execute"


def cut_off(folder, *, seconds=60.0, lease=10.0, work=3.0, isolated=None):
    """Cut two workers off, each from a daemon of its own; one of these finds a substitute.

    Where nobody else ran it, the late result is the result; where a substitute did, it is known.
    """
    report = Report(f"cut off: {seconds:g} s and back (leases last {lease:g} s)")
    isolated = may_make_namespaces() if isolated is None else isolated
    report.fact("cable", "veth pair taken down" if isolated else "relay that stops")
    with ExitStack() as stack:
        sides = [
            _Side(stack, folder / name, lease, isolated=isolated) for name in ("alone", "replaced")
        ]
        for side in sides:
            side.client.submit(make_submission("cut", 1, sleep=work))
            eventually(side.begun)
            side.cable.cut()
            now = side.client.overview()
            report.expect(now.running == 1, "the run was over before the cable was cut")
        cut = time.monotonic()
        for side in sides:
            eventually(side.lapsed, 3 * lease + 60.0)
        report.fact("leases over after", f"{time.monotonic() - cut:.1f} s")
        stack.enter_context(worker_for(sides[1].daemon, executor=EXECUTOR))
        eventually(lambda: finished(sides[1].client, 1))
        time.sleep(max(0.0, seconds - (time.monotonic() - cut)))
        report.expect(sides[0].client.overview().queued == 1, "the run did not wait for anybody")
        for side in sides:
            side.cable.mend()
        mended = time.monotonic()
        for side in sides:
            eventually(side.delivered)
        report.fact("delivered after the cable was back", f"{time.monotonic() - mended:.1f} s")
        counted = [side.counted() for side in sides]
        report.fact("attempt that counts alone, replaced", counted)
        report.expect(counted == [1, 2], f"attempts {counted} count, wanted [1, 2]")
        for side in sides:
            verify(report, side.daemon.state, 1)
    return report


class _Side:
    """A daemon, and a worker at the end of a cable that executes its only run."""

    def __init__(self, stack, folder, lease, *, isolated):
        self._folder = folder
        endpoint, (self.cable,) = stack.enter_context(links(free_endpoint(), 1, isolated=isolated))
        self.daemon = stack.enter_context(
            daemon_at(folder / "state", listen=endpoint, lease=lease, attempts=100)
        )
        self.client = stack.enter_context(self.daemon.client())
        worker = worker_for(
            self.daemon,
            1,
            *("--state", str(folder / "away")),
            connect=self.cable.endpoint,
            through=self.cable.through,
            executor=EXECUTOR,
        )
        stack.enter_context(worker)
        stack.callback(self.cable.mend)

    def begun(self):
        """Whether the run's process is there, and nothing is needed from the daemon any more."""
        return bool(
            list(matching_paths(self._folder, "away/work/*/spool/*/*/attempt-1.*/output.txt"))
        )

    def lapsed(self):
        return self.client.overview().running == 0

    def counted(self):
        """The attempt whose result is the one."""
        with closing(sqlite3.connect(self.daemon.state / "ledger.db")) as db:
            return int(db.execute("SELECT attempt FROM result").fetchone()[0])

    def delivered(self):
        left = matching_paths(self._folder, "away/work/*/spool/*/*/attempt-*")
        return finished(self.client, 1) and not list(left)
