"""A key that asks without end, and a key that is taken back."""

import os
import shutil
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import ExitStack, contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path

from daemon.batch.client import Client
from daemon.batch.errors import DaemonError
from daemon.batch.paths import StatePaths
from daemon.batch.security.authority import create_authority, issue_key, pack_key
from daemon.model.verbs import Role
from tests.chaos.executions import Executions
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.daemon.batch.harness import (
    ROOT,
    daemon_at,
    eventually,
    finished,
    free_endpoint,
    worker_for,
)
from tests.daemon.batch.samples import make_submission

EXECUTOR = "tests.chaos.executor:execute"


@contextmanager
def guarded(folder, *workers):
    """A daemon that asks for keys, and the folder of keys; ``workers`` have one each."""
    keys = folder / "keys"
    folder.mkdir(parents=True, exist_ok=True)
    now = datetime.now(UTC).replace(microsecond=0)
    create_authority(keys, ("localhost", "127.0.0.1"), now)
    for name in workers:
        issue_key(keys, Role.WORKER, name, (), now)
    listen = free_endpoint().replace("tcp/", "tls/")
    settings = {"listen": listen, "keys": str(keys)}
    with daemon_at(folder / "state", **settings) as daemon:
        eventually(lambda: StatePaths(daemon.state).read_contact())
        with owner(daemon) as client:
            eventually(lambda: client.overview() is not None)
        yield daemon, keys


def owner(daemon):
    """A client at the daemon's own socket, whom no flood at the port concerns."""
    return Client.open(StatePaths(daemon.state).endpoint, timeout=30.0)


def flood(folder, *, runs=20, askers=8):
    """One key asks as fast as it can, while a worker with another one executes runs."""
    report = Report("flood: a key that asks without end")
    log = Executions(folder / "executions")
    stop, asked = threading.Event(), Counter[str]()
    with ExitStack() as stack:
        daemon, keys = stack.enter_context(guarded(folder, "good"))
        pack_key(keys, "worker.good", folder / "good")
        client = stack.enter_context(owner(daemon))
        start_worker = worker_for(
            daemon, 2, "--keys", str(folder / "good"), "--state", str(folder / "away"),
            executor=EXECUTOR,
        )  # fmt: skip
        stack.enter_context(start_worker)
        eventually(client.workers)
        threads = [
            threading.Thread(target=_ask, args=(daemon, keys / "viewer", stop, asked))
            for _ in range(askers)
        ]
        stack.callback(stop.set)
        for thread in threads:
            thread.start()
        start = time.monotonic()
        client.submit(make_submission("work", runs, sleep=0.5, log=str(log.path)))
        eventually(lambda: finished(client, runs), 180.0)
        took = time.monotonic() - start
        stop.set()
        for thread in threads:
            thread.join()
        report.fact("asked meanwhile", f"{asked['answered'] / took:.0f} /s answered, {asked}")
        report.executions, report.started_over = log.begun.total(), log.started_over
        report.expect(not log.started_over, f"{log.started_over} runs were started over")
        verify(report, daemon.state, runs)
    return report


def _ask(daemon, key, stop, asked):
    while not stop.is_set():
        try:
            with Client.open(daemon.endpoint, keys=key, timeout=5.0) as client:
                while not stop.is_set():
                    client.overview()
                    asked["answered"] += 1
        except DaemonError:
            asked["refused"] += 1  # a limit on the rate: it asks on


def voided(folder, *, runs=12):
    """What a key delivered that is revoked with --void does not count: it is executed again."""
    report = Report("void: a key is taken back with what it delivered")
    log = Executions(folder / "executions")
    with ExitStack() as stack:
        daemon, keys = stack.enter_context(guarded(folder, "good", "bad"))
        client = stack.enter_context(owner(daemon))
        for name in ("good", "bad"):
            pack_key(keys, f"worker.{name}", folder / name)
        bad = worker_for(
            daemon, 2, "--keys", str(folder / "bad"), "--state", str(folder / "away-bad"),
            executor=EXECUTOR,
        )  # fmt: skip
        client.submit(make_submission("first", runs, log=str(log.path)))
        with bad:
            eventually(lambda: finished(client, runs))
        done = _command(daemon, keys, "keys", "revoke", "worker.bad", "--void", "--yes")
        report.fact("keys revoke --void", (done.stdout + done.stderr).strip()[-300:])
        if not report.expect(done.returncode == 0, f"keys revoke left with {done.returncode}"):
            return report
        good = worker_for(
            daemon, 2, "--keys", str(folder / "good"), "--state", str(folder / "away-good"),
            executor=EXECUTOR,
        )  # fmt: skip
        stack.enter_context(good)
        with suppress(AssertionError):
            eventually(lambda: log.ended.total() == 2 * runs and finished(client, runs))
        again = log.begun.total() - runs
        report.executions = log.begun.total()
        report.expect(again == runs, f"{again} of {runs} runs were executed again")
        verify(report, daemon.state, runs)
    return report


def _command(daemon, keys, *words):
    """The command line as people use it, on the daemon's machine."""
    scenario = shutil.which("scenario", path=str(Path(sys.executable).parent))
    base = [scenario] if scenario else [sys.executable, "-m", "scenario_tui"]
    settings = {"SCENARIO_STATE": str(daemon.state), "SCENARIO_KEYS": str(keys)}
    return subprocess.run(
        [*base, *words],
        env={**os.environ, **settings},
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=120.0,
    )
