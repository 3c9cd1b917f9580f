"""Bits flip in a write-ahead log at rest: nothing that was acknowledged a while ago is lost."""

import random
import time

from tests.chaos.report import Report
from tests.chaos.verify import check_book
from tests.make import make_submission
from tests.parts import daemon_at

IDLE = 3.0
"""Seconds without a request, after which nothing acknowledged may lie in the log alone."""


def bits(folder, *, campaigns=20, times=5, idle=IDLE, seed=1):
    """Kill an idle daemon, flip a bit of its log, start it again: every campaign is there."""
    report = Report("bits: one flips in the write-ahead log of a daemon at rest")
    rng = random.Random(seed)
    flipped = 0
    with daemon_at(folder / "state") as daemon:
        for turn in range(times):
            with daemon.client() as client:
                for number in range(campaigns):
                    client.submit(make_submission(f"c{turn}-{number}", 1))
            time.sleep(idle)
            daemon.kill()
            flipped += _flip(daemon.state / "ledger.db-wal", rng)
            daemon.restart()
            with daemon.client() as client:
                there = len(client.campaigns())
            wanted = (turn + 1) * campaigns
            report.expect(there == wanted, f"{there} of {wanted} acknowledged campaigns are there")
        daemon.kill()
        check_book(report, daemon.state / "ledger.db")
    report.fact("logs with a bit flipped", f"{flipped} of {times} (the others were empty)")
    report.runs = times * campaigns
    return report


def _flip(log, rng):
    """Flip a bit of the first half; returns whether there was one."""
    data = bytearray(log.read_bytes()) if log.exists() else bytearray()
    if not data:
        return False
    at = rng.randrange(max(1, len(data) // 2))
    data[at] ^= 1 << rng.randrange(8)
    log.write_bytes(data)
    return True
