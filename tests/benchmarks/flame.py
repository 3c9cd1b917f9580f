"""Where the time of a run goes, function by function: a flame graph by one command.

``python -m tests.benchmarks flame [CASE] [-o FILE.svg]``, with the cases of ``against``; S1 of the
published experiment unless told otherwise. Needs py-spy (``pip install py-spy``), which looks at a
process a hundred times a second from outside: the run is not slowed down, and compiled kernels are
shown by the function that calls them.
"""

import argparse
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

from tests.benchmarks import progress
from tests.benchmarks.against import RUNS
from tests.benchmarks.case_process import REFERENCE
from tests.benchmarks.measurement import Measurement, Reference
from tests.parts import ROOT

RATE = 100
MOST = 25
_PROGRAM = "from tests.benchmarks.case_process import cpu_of_case; cpu_of_case({case!r})"


def record(py_spy, case, output, kind):
    """Have a process execute the case and write what py-spy has seen of it."""
    program = _PROGRAM.format(case=case)
    command = [py_spy, "record", "--rate", str(RATE), "--format", kind, "--output", str(output)]
    progress.say(f"{case}, recorded as {kind}")
    said = subprocess.run(
        [*command, "--", sys.executable, "-c", program], cwd=ROOT, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    if said.returncode:
        raise RuntimeError(f"py-spy: {said.stdout}")


def own_time(stacks):
    """Count the samples of each function, below ``execute``, and all of them."""
    counted = Counter()
    for line in stacks.splitlines():
        stack, _, samples = line.rpartition(" ")
        if "execute (daemon/run.py" in stack:
            counted[f"{stack.split(';')[-1].rpartition(':')[0]})"] += int(samples)
    return counted, counted.total()


def main(arguments):
    """Draw the graph, and yield the functions that take most of the time by themselves."""
    parser = argparse.ArgumentParser("tests.benchmarks flame", description=__doc__)
    parser.add_argument("case", nargs="?", choices=RUNS, default=REFERENCE)
    parser.add_argument("-o", "--output", type=Path, default=Path("flame.svg"))
    asked = parser.parse_args(arguments)
    beside = shutil.which("py-spy", path=str(Path(sys.executable).parent))
    py_spy = beside or shutil.which("py-spy")
    if py_spy is None:
        parser.error("py-spy is not installed: pip install py-spy")
    raw = asked.output.with_suffix(".txt")
    record(py_spy, asked.case, raw, "raw")
    counted, everything = own_time(raw.read_text("utf-8"))
    record(py_spy, asked.case, asked.output, "flamegraph")
    progress.clear()
    print(f"flame graph: {asked.output}, its stacks as text: {raw}")
    for function, samples in counted.most_common(MOST):
        whole = Reference("the run", everything / RATE)
        name, _, file = function.rstrip(")").partition(" (")
        yield Measurement(name, samples / RATE, "s", whole, note=file)
