"""A worker's share of its machine is measured over all of its processes."""

import subprocess
import sys

import psutil

from daemon.batch.worker import _usage
from daemon.batch.worker._usage import UsageMeter

ALLOCATED = 100 * 2**20
PROGRAM = f"""
data = b"x" * {ALLOCATED}
total = sum(data[:20_000_000])
print(flush=True)
input()
"""


def test_memory_and_processor_time_of_children_count(monkeypatch):
    monkeypatch.setattr(_usage, "_PERIOD", 0.0)
    meter = UsageMeter()
    before = meter.measure()
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", PROGRAM], **pipes) as child:
        child.stdout.readline()
        during = meter.measure()
        child.communicate(b"\n")
    assert during.memory - before.memory > 0.9 * ALLOCATED
    assert 0.0 < during.cpu <= 1.0
    assert before.memory_total == psutil.virtual_memory().total
    assert meter.measure().memory < during.memory - 0.9 * ALLOCATED


def test_the_processes_are_looked_at_once_a_second_at_most():
    meter = UsageMeter()
    assert meter.measure() is meter.measure()
