"""Bad networks: cuts of every length, lost packets, delay, a slow line, and a daemon that restarts.

Every case has a daemon, a worker at the end of its line and runs whose traces travel over it; all
cases go on at the same time. What is begun is counted by the runs themselves.
"""

import sqlite3
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass

from grammars.text.files import matching_paths
from tests.chaos.executor import EXECUTOR, Executions
from tests.chaos.links import UNLIMITED, links, may_make_namespaces, relay
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.make import make_spec, submission_of
from tests.parts import daemon_at, eventually, finished, free_endpoint, worker_for

LEASE = 30.0
PATIENCE = 300.0


@dataclass(frozen=True, slots=True)
class Case:
    """A line, what happens to it, and the runs meanwhile: ``work`` has the seconds of each.

    ``cuts`` [s] follow each other ``gap`` seconds apart, the first when as many runs as there are
    ``slots`` have begun. With ``spare`` another worker, never cut off, waits for runs. The daemon
    is killed and started again ``restarts`` times. ``loss`` is a share of packets, ``delay`` [s]
    and ``rate`` [bytes/s] are of each direction, ``ballast`` are bytes of a trace. A line that
    ``breaks`` ends its connections when it is cut; others go silent.
    """

    name: str
    work: tuple[float, ...]
    cuts: tuple[float, ...] = ()
    gap: float = 6.0
    slots: int = 2
    spare: bool = False
    restarts: int = 0
    loss: float = 0.0
    delay: float = 0.0
    rate: float = 0.0
    ballast: int = 20_000
    breaks: bool = False


CASES = (
    Case("cut 3 s", (2.0, 12.0), (3.0,)),
    Case("cut 14 s", (5.0, 25.0), (14.0,)),
    Case("cut 14 s, a spare worker", (5.0, 25.0), (14.0,), spare=True),
    Case("3 cuts of 14 s in a run of 65 s", (65.0, 65.0), (14.0, 14.0, 14.0), spare=True),
    Case("cut 40 s", (10.0, 50.0), (40.0,)),
    Case("cut 60 s, a spare worker", (10.0, 10.0), (60.0,), spare=True),
    Case("cut 120 s", (20.0, 130.0), (120.0,)),
    Case("broken for 20 s, a spare worker", (30.0,) * 2, (20.0,), breaks=True, spare=True),
    Case("loss 10 %", (0.5,) * 40, loss=0.1, slots=4, ballast=200_000),
    Case("loss 30 %", (0.5,) * 12, loss=0.3, slots=4, ballast=50_000),
    Case("delay 200 ms", (0.5,) * 60, delay=0.1, slots=8),
    Case("slow line, 40 kB/s", (2.0,) * 8, rate=40_000, slots=4, ballast=300_000),
    Case("cut 14 s, far and slow", (20.0,) * 2, (14.0,), delay=0.1, rate=40_000, spare=True),
    Case("daemon killed 3 times, cut 3 s", (20.0,) * 4, (3.0, 3.0, 3.0), restarts=3),
)


def network(folder):
    """Perform all cases at once.

    Every run is done exactly once. None is started over, but where the line was cut for longer
    than a lease lasts and somebody else was there to take the run: then the substitute's result,
    which came first, is the one.
    """
    report = Report("network: cuts, loss, delay, a slow line")
    isolated = may_make_namespaces()
    report.fact("cables", "veth pairs to namespaces" if isolated else "relays")
    with ExitStack() as stack:
        # Relays cannot lose packets: where there are no namespaces, those cases are left out.
        chosen = [case for case in CASES if isolated or not case.loss]
        scenes = [
            _Scene(stack, folder / f"{i}", case, isolated=isolated) for i, case in enumerate(chosen)
        ]
        with ThreadPoolExecutor(len(scenes)) as threads:
            for part in threads.map(_Scene.perform, scenes):
                report.include(part)
    return report


def worker_at(daemon, line, slots, state):
    """A worker at the end of a line, with a state directory of its own."""
    return worker_for(
        daemon,
        slots,
        *("--state", str(state)),
        connect=line.endpoint,
        through=line.through,
        executor=EXECUTOR,
    )


class _Scene:
    """The daemon, the line and the workers of a case."""

    def __init__(self, stack, folder, case, *, isolated):
        self._stack, self._folder, self._case = stack, folder, case
        self._log, self._over = Executions(folder / "executions"), 0
        endpoint = free_endpoint()
        if case.delay or case.rate or case.breaks:
            shaped = relay(endpoint, delay=case.delay, rate=case.rate or UNLIMITED)
            line = stack.enter_context(shaped)
        else:
            endpoint, (line,) = stack.enter_context(links(endpoint, 1, isolated=isolated))
        self._line = line
        self._daemon = stack.enter_context(
            daemon_at(folder / "state", listen=endpoint, lease=LEASE, attempts=3)
        )
        self._daemon.client().close()
        stack.enter_context(worker_at(self._daemon, line, case.slots, folder / "away"))
        stack.callback(line.mend)
        self._whole = bool(case.loss) and not line.drop_packets(case.loss)

    def perform(self):
        """The case from its submission to its end."""
        case = self._case
        report = Report(f"{case.name} (this kernel loses none)" if self._whole else case.name)
        try:
            self._act()
        except AssertionError as error:
            report.violations.append(str(error))
        report.end()
        report.count(self._log)
        verify(report, self._daemon.state, len(case.work))
        over, cut = report.started_over, max(case.cuts, default=0.0)
        replaced = case.spare and cut >= LEASE
        report.expect(replaced or not over, f"{over} runs were started over")
        # Where all of it happens while the line is cut, the substitute is there first.
        if replaced and not self._over and cut > LEASE + 2 * max(case.work):
            attempts = self._counted()
            report.expect(set(attempts) == {2}, f"attempts {attempts} count, wanted 2")
        return report

    def _counted(self):
        """The attempts whose results are the ones."""
        with closing(sqlite3.connect(self._daemon.state / "ledger.db")) as db:
            return [attempt for (attempt,) in db.execute("SELECT attempt FROM result")]

    def _act(self):
        case = self._case
        specs = [
            make_spec(i, sleep=work, ballast=case.ballast, log=str(self._log.path))
            for i, work in enumerate(case.work)
        ]
        with self._daemon.client() as client:
            client.submit(submission_of("network", *specs))
            if case.cuts:
                eventually(lambda: len(self._log.begun) >= min(case.slots, len(specs)))
            if case.spare:
                self._stack.enter_context(worker_for(self._daemon, 2, executor=EXECUTOR))
                eventually(lambda: len(client.workers()) == 2)
        self._over = self._log.counted("end").total()
        for number, seconds in enumerate(case.cuts):
            if number:
                time.sleep(case.gap)
            (self._line.sever if case.breaks else self._line.cut)()
            if number < case.restarts:
                self._daemon.kill()
                self._daemon.restart()
            time.sleep(seconds)
            self._line.mend()
        with self._daemon.client() as client:
            eventually(lambda: self._at_rest(client), PATIENCE)

    def _at_rest(self, client):
        left = matching_paths(self._folder, "away/work/*/spool/*/*/attempt-*")
        return finished(client, len(self._case.work)) and not list(left)
