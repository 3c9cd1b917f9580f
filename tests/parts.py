"""Real daemons and workers for tests: processes on loopback, to be watched and killed."""

import json
import os
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from contextlib import closing, contextmanager
from pathlib import Path

import psutil

from daemon.batch.amounts import parse_size
from daemon.batch.client import Client
from daemon.batch.errors import DaemonError
from tests.prepared_parts import start_prepared

EXECUTOR = "tests.fake_run:execute"
ROOT = Path(__file__).parents[1]
NICE = 0
"""In tests runs step back behind nothing: beside other tests they would take ten times as long."""


def _in_test():
    """Elsewhere, in benchmarks, what is started is started as by everybody."""
    return "PYTEST_CURRENT_TEST" in os.environ


def free_endpoint():
    """An endpoint at which nobody listens, and that is given to nobody else meanwhile.

    The port stays bound as long as this process lives: only who sets SO_REUSEADDR, as servers do,
    can still listen there. Else another process of the tests gets it before a daemon is up.
    """
    held = socket.socket()
    held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    held.bind(("127.0.0.1", 0))
    port = held.getsockname()[1]
    held.detach()
    return f"tcp/127.0.0.1:{port}"


DEADLINE = 120.0
"""Seconds after which a test is broken, and not the machine busy: below the limit of pytest."""
# Most conditions are questions to a daemon, for which both have to work: what is waited for long is
# asked for less often.
_FIRST_PAUSE = 0.01
_LONGEST_PAUSE = 0.05


def eventually(condition, seconds=DEADLINE):
    """Wait until ``condition`` gives something true, and return that.

    The deadline only tells a broken test from a slow machine: what a test has to find out by the
    time something takes, it finds out by making every other cause impossible for longer. Pauses
    count as long as they were to be: a process that is kept waiting for a processor waits longer.
    """
    remaining, pause = seconds, _FIRST_PAUSE
    while not (value := condition()):
        assert remaining > 0.0, "it did not happen in time"
        time.sleep(pause)
        remaining -= pause
        pause = min(1.2 * pause, _LONGEST_PAUSE)
    return value


def family(pid):
    """A process and everything it started."""
    process = psutil.Process(pid)
    return [process, *process.children(recursive=True)]


def alive(processes):
    """Those of the processes that still run; one that nobody has waited for yet does not."""
    return [p for p in processes if _runs(p)]


def _runs(process):
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def order(options):
    """The JSON of ``--name value`` options: whatever a daemon or a worker can be told."""
    known = {"--quota": parse_size, "--slots": json.loads, "--step-back": json.loads}
    known |= dict.fromkeys(("--lease", "--attempts", "--patience"), json.loads)
    known |= dict.fromkeys(("--wall", "--memory", "--nice"), json.loads)
    groups = {"settings": {"lease", "attempts", "patience", "quota", "traces"}}
    groups["limits"] = {"wall", "memory", "nice"}
    names = {"traces": "store", "step-back": "nice"}
    told = {}
    for option, text in zip(options[::2], options[1::2], strict=True):
        name = option.removeprefix("--")
        group = next((group for group, members in groups.items() if name in members), None)
        place = told.setdefault(group, {}) if group else told
        place[names.get(name, name)] = known.get(option, str)(text)
    return json.dumps(told)


class Part:
    """A daemon or worker process of this test."""

    def __init__(self, command, log, *options, module="daemon", through=()):
        self._command = [*through, sys.executable, "-m", module, command, order(options)]
        self._log = log
        self._prepared = _in_test() and not through
        self.process = self._start()

    def _start(self):
        with self._log.open("ab") as output:
            if self._prepared:
                part = start_prepared(self._command[2:], ROOT, output.fileno())
                if part is not None:
                    return part
            return subprocess.Popen(
                self._command,
                cwd=ROOT,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )

    @property
    def pid(self):
        return self.process.pid

    @property
    def output(self):
        return self._log.read_text()

    def signal(self, number):
        self.process.send_signal(number)

    def freeze(self):
        self.signal(signal.SIGSTOP)
        process = psutil.Process(self.pid)
        eventually(lambda: process.status() == psutil.STATUS_STOPPED)

    def wait(self, seconds=DEADLINE):
        return self.process.wait(seconds)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def restart(self):
        self.process = self._start()


class DaemonPart(Part):
    """A daemon on a state directory."""

    def __init__(self, state, slots, **settings):
        self.state = state
        self.endpoint = str(settings.pop("listen", "")) or free_endpoint()
        module = settings.pop("module", "daemon")
        options = ["--state", str(state), "--listen", self.endpoint, "--slots", str(slots)]
        for name, value in settings.items():
            options += [f"--{name}", str(value)]
        super().__init__("serve", state.parent / f"{state.name}.log", *options, module=module)

    def journal(self):
        log = self.state / "daemon.log"  # there from the first line on
        return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []

    def noted(self, event):
        """The lines of the journal about ``event``."""
        return [line for line in self.journal() if line["event"] == event]

    def client(self, timeout=30.0):
        """A connection, as soon as the daemon answers."""

        def connect():
            try:
                client = Client.open(self.endpoint, timeout=timeout)
            except DaemonError:
                assert self.process.poll() is None, self.output
                return None
            try:
                client.overview()
            except DaemonError:
                client.close()
                return None
            return client

        return eventually(connect)


def end(processes):
    """End processes this test started, whatever state they are in."""
    for process in processes:
        try:
            process.kill()
            os.kill(process.pid, signal.SIGCONT)
        except (psutil.NoSuchProcess, ProcessLookupError):
            continue
    eventually(lambda: not alive(processes))


@contextmanager
def daemon_at(state, slots=0, **settings):
    """A daemon for the block; nothing of it is left afterwards.

    ``settings`` are options of ``serve``; ``module`` is run instead of ``daemon``.
    A lease outlasts the test: on a busy machine a worker may be late to renew it. What a worker
    says when it renews, that it is in trouble for example, it says after a third of a lease.
    """
    state.parent.mkdir(parents=True, exist_ok=True)
    usual = {"patience": 2.0, "lease": 1800.0, "executor": EXECUTOR}
    if _in_test():
        usual["nice"] = NICE
    part = DaemonPart(state, slots, **(usual | settings))
    try:
        yield part
    finally:
        _finish(part)


@contextmanager
def worker_for(
    daemon, slots=1, *options, connect="", through=(), executor=EXECUTOR, module="daemon"
):
    """A worker of its own for the block; nothing of it is left afterwards.

    ``module`` is run instead of ``daemon``. A worker leaves where no daemon listens yet.
    """
    eventually(lambda: daemon.noted("started"))
    log = daemon.state.parent / f"worker-{time.monotonic_ns()}.log"
    base = ("--connect", connect or daemon.endpoint, "--slots", str(slots))
    if _in_test():
        options = ("--nice", str(NICE), *options)
    part = Part(
        "worker", log, *base, "--executor", executor, *options, through=through, module=module
    )
    try:
        yield part
    finally:
        _finish(part)


def _finish(part):
    try:
        members = family(part.pid)
    except psutil.NoSuchProcess:
        members = []
    if part.process.poll() is None:
        part.signal(signal.SIGTERM)
        part.signal(signal.SIGCONT)
        try:
            part.wait(30.0)
        except subprocess.TimeoutExpired:
            part.kill()
    end(members)


def finished(client, runs):
    """Whether that many runs are at rest and nothing is under way."""
    now = client.overview()
    return now.queued == now.running == 0 and now.done + now.lost + now.cancelled == runs


def finish(client, campaign):
    """The runs of a campaign, once it is finished."""
    eventually(lambda: client.campaign(campaign).finished)
    return client.runs(campaign).rows


def recorded(daemon, query):
    """The rows that a query of a daemon's ledger gives."""
    with closing(sqlite3.connect(daemon.state / "ledger.db")) as ledger:
        return ledger.execute(query).fetchall()


def executions(log, count=0):
    """The processes that runs with that ``log`` were executed by, unless they are fewer."""
    lines = log.read_text().splitlines() if log.exists() else []
    return [int(line.split()[1]) for line in lines] if len(lines) >= count else []
