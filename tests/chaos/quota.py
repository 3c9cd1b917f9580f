"""Nobody may write any more (EDQUOT), and a disk that is full when the daemon starts."""

import time

from tests.chaos.disk import fill, may_mount, small_disk
from tests.chaos.executions import Executions
from tests.chaos.report import Report
from tests.chaos.verify import verify
from tests.make import make_submission
from tests.parts import Part, daemon_at, eventually, finished

EXECUTOR = "tests.chaos.executor:execute"
PER_MINUTE = 60


def quota(folder, *, runs=10, seconds=60.0):
    """Runs find no quota left for a while: they are tried ever more rarely, and it is said."""
    report = Report("quota: executions that fail for want of space")
    log, mark = Executions(folder / "executions"), folder / "quota"
    mark.touch()
    with daemon_at(folder / "state", 2, executor=EXECUTOR) as daemon, daemon.client() as client:
        client.submit(make_submission("quota", runs, log=str(log.path), quota=str(mark)))
        eventually(lambda: log.begun.total() >= min(2, runs))
        time.sleep(seconds)
        tried = log.begun.total()
        report.fact("executions while there was no quota", tried)
        most = runs + PER_MINUTE * seconds / 60.0
        report.expect(tried <= most, f"{tried} executions in {seconds:g} s, at most {most:g}")
        named = eventually(lambda: client.overview().troubles)
        report.fact("said of it", named[0].words[-80:])
        mark.unlink()
        eventually(lambda: finished(client, runs), 300.0)
        report.executions = log.begun.total()
        verify(report, daemon.state, runs)
    return report


def full_start(folder):
    """The disk is full when the daemon starts: it says so and leaves; with room it starts."""
    report = Report("full start: a daemon on a full disk")
    if not may_mount():
        report.fact("skipped", "mounting a small file system needs root")
        return report
    with small_disk(folder / "disk") as disk:
        state, ballast = disk / "state", disk / "ballast"
        with daemon_at(state, 1, executor=EXECUTOR) as daemon:
            daemon.client().close()
            daemon.kill()
            fill(ballast)
            early = Part("serve", folder / "early.log", "--state", str(state))
            report.expect(early.wait() == 3, f"it ended with {early.process.returncode}")
            words = ("No space left", "is full")
            report.expect(any(one in early.output for one in words), f"it said {early.output}")
            ballast.unlink()
            daemon.restart()
            with daemon.client() as client:
                client.submit(make_submission("after", 2))
                eventually(lambda: finished(client, 2))
        verify(report, state, 2)
    return report
