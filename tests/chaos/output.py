"""Results of megabytes: the daemon stays small, and nobody else suffers."""

import psutil

from tests.chaos.executor import EXECUTOR, Executions
from tests.chaos.report import Report
from tests.make import make_spec, submission_of
from tests.parts import daemon_at, eventually, finished

MIB = 2**20
PATIENCE = 600.0
"""Seconds on a machine that has much else to do."""
MOST_MEMORY = 500 * MIB
"""Bytes of the daemon."""


def output(folder, *, huge=60, evidence=4 * 1000 * 1000, others=10):
    """Deliver far too much beside runs as usual: these are done, memory stays small."""
    report = Report("output: results of megabytes")
    log = Executions(folder / "executions")
    usual = [make_spec(i, sleep=0.2, log=str(log.path)) for i in range(others)]
    large = [make_spec(i, scenario="huge", evidence=evidence) for i in range(huge)]
    runs = others + huge
    with (
        daemon_at(folder / "state", 4, executor=EXECUTOR, attempts=1) as daemon,
        daemon.client() as client,
    ):
        client.submit(submission_of("huge", *large))
        client.submit(submission_of("usual", *usual))
        eventually(lambda: finished(client, runs), PATIENCE)
        done = {row.id: row.done for row in client.campaigns()}
        report.fact("done", done)
        report.expect(len(done) == 2, "the campaigns are not listed any more")
        report.expect(done.get("usual") == others, "runs beside them were not done")
        for row in client.runs("huge", limit=3).rows:
            client.run(row.id)
        memory = psutil.Process(daemon.pid).memory_info().rss
        report.fact("memory of the daemon", f"{memory / MIB:.0f} MiB")
        report.expect(memory <= MOST_MEMORY, f"the daemon takes {memory} bytes")
        report.expect_none_started_over(log)
    report.runs = runs
    return report
