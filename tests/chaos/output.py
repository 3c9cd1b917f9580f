"""Runs that print without end and results of megabytes: both stay bounded, nobody else suffers."""

import psutil

from grammars.text.files import matching_paths
from tests.chaos.executor import EXECUTOR, Executions
from tests.chaos.report import Report
from tests.make import make_spec, submission_of
from tests.parts import daemon_at, eventually, finished

MIB = 2**20
LARGEST_OUTPUT = 2 * MIB
"""Bytes of one run's output on the disk, at most, while it prints on."""
PATIENCE = 600.0
"""Seconds for tens of megabytes in short lines, on a machine that has much else to do."""
MOST_MEMORY = 500 * MIB
"""Bytes of the daemon."""


def output(folder, *, chatty=4, chatter=32 * MIB, huge=60, evidence=4 * 1000 * 1000, others=10):
    """Print and deliver far too much beside runs as usual: these are done, memory stays small."""
    report = Report("output: runs that print without end, results of megabytes")
    log, gate = Executions(folder / "executions"), folder / "gate"
    usual = [make_spec(i, sleep=0.2, log=str(log.path)) for i in range(others)]
    said = Executions(folder / "said")
    asked = {"chatter": chatter, "until": str(gate), "log": str(said.path)}
    talkers = [make_spec(i, scenario="talk", **asked) for i in range(chatty)]
    large = [make_spec(i, scenario="huge", evidence=evidence) for i in range(huge)]
    runs = len(usual) + chatty + huge
    with (
        daemon_at(folder / "state", chatty, executor=EXECUTOR, attempts=1) as daemon,
        daemon.client() as client,
    ):
        client.submit(submission_of("talk", *talkers))
        eventually(lambda: client.overview().running == chatty)
        eventually(lambda: said.counted("said").total() == chatty, PATIENCE)
        sizes = [_size(path) for path in _outputs(daemon.state)]
        report.fact("largest output of a run", f"{max(sizes) / MIB:.1f} MiB")
        report.expect(max(sizes) <= LARGEST_OUTPUT, f"an output of {max(sizes)} bytes")
        gate.touch()
        client.submit(submission_of("huge", *large))
        client.submit(submission_of("usual", *usual))
        eventually(lambda: finished(client, runs), PATIENCE)
        rows = client.campaigns()
        report.expect(len(rows) == 3, "the campaigns are not listed any more")
        done = {row.id: row.done for row in rows}
        report.fact("done", done)
        report.expect(done["usual"] == len(usual), "runs beside them were not done")
        report.expect(done["talk"] == chatty, "runs that print were not done")
        for row in client.runs("huge", limit=3).rows:
            client.run(row.id)
        memory = psutil.Process(daemon.pid).memory_info().rss
        report.fact("memory of the daemon", f"{memory / MIB:.0f} MiB")
        report.expect(memory <= MOST_MEMORY, f"the daemon takes {memory} bytes")
        report.expect_none_started_over(log)
    report.runs = runs
    return report


def _outputs(state):
    return list(matching_paths(state, "spool/*/*/attempt-*/output.txt*"))


def _size(path):
    return path.stat().st_size if path.exists() else 0
