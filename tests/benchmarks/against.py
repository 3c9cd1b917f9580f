"""An older commit against the working tree, in one run, in turns.

``python -m tests.benchmarks against REV [CASE ...] [-n TIMES]``. What lies in ``REV`` is written
into a folder of the user's cache (``git archive``) and stays there with its machine code, so the
second time is quicker. Either checkout has a process for its runs; a command is a process each
time. All of them use the interpreter and the libraries of this process. Everything is done in
turns, first one, then the other, then the other way round: what disturbs one disturbs the other.
"""

import argparse
import io
import json
import statistics
import subprocess
import sys
import tarfile
import tempfile
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import platformdirs

from tests.benchmarks import progress
from tests.benchmarks.case_process import CAMPAIGNS, CORRIDORS
from tests.benchmarks.measurement import Measurement, Reference, cpu_of, kept_bytecode
from tests.parts import ROOT

RUNS = (*CORRIDORS, *CAMPAIGNS)
COMMANDS = {"help": ("--help",), "check": ("check", "campaigns/demo/campaign.yaml")}
TIMES = 5
BEGINNING = 20.0
"""Simulated seconds of a run that are not counted."""
_PROGRAM = "import sys; from scenario_tui.cli import main; main(sys.argv[1:])"


class Sample(NamedTuple):
    """What one time of a case took [CPU s], and for runs what came of it."""

    cpu: float
    simulated: float = 0.0
    digest: str = ""


class Checkout:
    """One of the two trees, with its process for runs."""

    def __init__(self, folder, stack):
        self._folder, self._stack = folder, stack
        # The tree comes before what the environment has.
        self._environment = kept_bytecode(PYTHONPATH=str(folder))

    def take(self, case):
        """Do a case once."""
        return self._run(case) if case in RUNS else self._command(*COMMANDS[case])

    def prepare(self, case):
        """Do as much of a case that files have been read and kernels compiled."""
        if case in RUNS:
            self._run(f"{case} {BEGINNING}")
        else:
            self.take(case)

    @cached_property
    def _process(self):
        script = Path(__file__).with_name("case_process.py")
        process = self._stack.enter_context(
            subprocess.Popen(
                [sys.executable, "-P", str(script)],
                cwd=self._folder, env=self._environment, text=True,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            )
        )  # fmt: skip
        self._stack.callback(process.kill)
        if Path(self._answer(process)).resolve() != self._folder.resolve():
            raise RuntimeError(f"a process in {self._folder} imports the packages of elsewhere")
        return process

    def _run(self, line):
        process = self._process
        process.stdin.write(f"{line}\n")
        process.stdin.flush()
        return Sample(*self._answer(process))

    def _answer(self, process):
        line = process.stdout.readline()
        if not line:
            raise RuntimeError(f"the process in {self._folder} has ended: its output says why")
        return json.loads(line)

    def _command(self, *arguments):
        command = [sys.executable, "-P", "-c", _PROGRAM, *arguments]
        return Sample(cpu_of(command, self._environment, self._folder))


def archived(revision):
    """Return the folder with what lies in a commit, written there unless it is there already.

    Raises ``LookupError`` where this is no checkout, or one without the commit.
    """
    found = subprocess.run(
        ["git", "rev-parse", "--verify", "--quiet", f"{revision}^{{commit}}"],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    if found.returncode:
        raise LookupError(f"no commit {revision} in {ROOT}")
    commit = found.stdout.strip()
    folder = platformdirs.user_cache_path("scenario-tui-benchmarks") / commit
    if not folder.exists():
        packed = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True)
        packed.check_returncode()
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as name:
            with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
                archive.extractall(Path(name, "tree"), filter="data")
            Path(name, "tree").rename(folder)
    return folder


def compare(revision, cases):
    """Yield a measurement for each case, done so many times, the older commit being the reference.

    Raises ``LookupError`` as :func:`archived`.
    """
    older = archived(revision)
    with ExitStack() as stack:
        checkouts = [Checkout(folder, stack) for folder in (older, ROOT)]
        for case, times in cases.items():
            for checkout, which in zip(checkouts, ("the older", "the newer"), strict=True):
                progress.say(f"{case}: {which} begins, not counted")
                checkout.prepare(case)
            old, new = _in_turns(checkouts, case, times)
            yield _compared(case, revision, old, new)


def _in_turns(checkouts, case, times):
    taken = ([], [])
    for k in range(times):
        progress.say(f"{case}: {k + 1} of {times}", case)
        for which in (0, 1) if k % 2 == 0 else (1, 0):
            taken[which].append(checkouts[which].take(case))
    return taken


def _compared(case, revision, old, new):
    ratios = [a.cpu / b.cpu for a, b in zip(old, new, strict=True)]
    before, now = (min(one.cpu for one in samples) for samples in (old, new))
    note = f"median of {len(new)} ratios {statistics.median(ratios):.2f}"
    if case not in RUNS:
        times_as_fast = f"{before / now:.2f} times as fast"
        shown = f"scenario {' '.join(COMMANDS[case])}"
        return Measurement(
            shown, now, "CPU s", Reference(revision, before), (), f"{times_as_fast}, {note}"
        )
    digests = [{one.digest for one in samples} for samples in (old, new)]
    same = "same bytes" if digests[0] == digests[1] and len(digests[0]) == 1 else "OTHER BYTES"
    return Measurement(
        case, new[0].simulated / now, "x real time",
        Reference(revision, old[0].simulated / before), (), f"{now:.2f} CPU s, {note}, {same}",
    )  # fmt: skip


def main(arguments):
    """Compare as the command line says."""
    parser = argparse.ArgumentParser("tests.benchmarks against", description=__doc__)
    parser.add_argument("revision", help="a commit, as git understands it")
    parser.add_argument("cases", nargs="*", metavar="case", help=", ".join((*RUNS, *COMMANDS)))
    parser.add_argument("-n", "--times", type=int, default=TIMES, help="of each")
    asked = parser.parse_args(arguments)
    if unknown := set(asked.cases) - {*RUNS, *COMMANDS}:
        parser.error(f"no case {', '.join(sorted(unknown))}")
    cases = asked.cases or (*RUNS, *COMMANDS)
    try:
        yield from compare(asked.revision, dict.fromkeys(cases, max(1, asked.times)))
    except LookupError as error:
        parser.error(str(error))
