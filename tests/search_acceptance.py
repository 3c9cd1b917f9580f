"""What a search must show, as tables: ``python -m tests.search_acceptance [PART...]``.

The demonstration's search ``doors-in-time`` is about all door times within 0.9 s of those written
and both speeds, twelve parameters. The parts are ``methods`` (random, space-filling and guided runs
at equal budget, the nearest failures, what proposing costs), ``found`` (the found file alone gives
the failure), ``same`` (equal lists of runs with one slot and with four, and after kills at every
tenth run, by real daemons), ``nothing`` (a space without a failure) and ``flat`` (an oracle that
cannot be followed is refused). Without a name all of them are shown. Results are kept by digest
while it lasts: the runs that methods share are executed once.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import shutil
import sys
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

from daemon.batch.client import Client
from daemon.campaign import expand, load_campaign
from daemon.model.execution import DEFAULT_EXECUTOR
from daemon.model.search_answer import SearchAnswer
from daemon.run import execute
from daemon.search import program
from daemon.search.client import SearchClient
from daemon.search.methods import SearchMethod
from daemon.search.points import changed_parameters
from daemon.search.preparation import prepare_search
from daemon.search.program import run_search
from grammars.text.diagnostics import InputError
from tests.analysis.search.cases import load_search_case
from tests.analysis.search.local_runs import LocalRuns
from tests.parts import daemon_at, eventually

ROOT = Path(__file__).parents[1]
CAMPAIGN = ROOT / "campaigns" / "demo" / "campaign.yaml"
NAME = "doors-in-time"
METHODS = ("random", "halton", "auto")
_SLOTS = 2
_KILL_EVERY = 10
_PATIENCE = 1800.0
"""Seconds after which a search by a daemon is broken, not slow."""
_HARMLESS = """
  noise-only:
    scenario: open-house
    minimise: keeps-clear
    over: {robot.laser.noise: 0.005 .. 0.02 m}
    budget: 20 runs
    method: halton
"""
_FLAT = """
  flat:
    scenario: open-house
    minimise: nearest
    over: {robot.laser.noise: 0.005 .. 0.02 m}
"""


@dataclass(slots=True)
class TimedMethod:
    """A method of search, with the CPU it takes [s]."""

    method: SearchMethod
    cpu: float = 0.0

    def propose(self):
        """Propose, and count the time."""
        return self._timed(self.method.propose)

    def learn(self, value):
        """Learn, and count the time."""
        self._timed(lambda: self.method.learn(value))

    def _timed(self, act):
        began = time.process_time()
        found = act()
        self.cpu += time.process_time() - began
        return found


@dataclass(frozen=True, slots=True)
class Measured:
    """One search: its answer, CPU [s] of proposing, of composing besides, and of its runs."""

    answer: SearchAnswer
    proposing: float
    program: float
    runs: float


def _children():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measure(case, results):
    """Run a search here, with the CPU of its parts."""
    timed = []

    def make(task, space):
        timed.append(TimedMethod(SearchMethod(task, space)))
        return timed[-1]

    before = program.SearchMethod
    program.SearchMethod = make
    own, children = time.process_time(), _children()
    try:
        answer = run_search(case, LocalRuns(slots=_SLOTS, results=results))
    finally:
        program.SearchMethod = before
    proposing = sum(one.cpu for one in timed)
    return Measured(
        answer, proposing, time.process_time() - own - proposing, _children() - children
    )


def case_of(seed, method, runs, **changes):
    """Return the demonstration's search with another seed, method and budget."""
    case = load_search_case(CAMPAIGN, NAME)
    asked = {"stop": "budget", "confirm": 0, "then": ()} | changes
    return replace(case, task=replace(case.task, seed=seed, method=method, runs=runs, **asked))


def show_methods(seeds, runs):
    """Print what each method finds at equal budget; whether it is what a search must show."""
    _title(f"{NAME}, {runs} runs each: first failure, failures, smallest margin [m]")
    found = {method: [] for method in METHODS}
    _row("method", "seed", "first", "failures", "smallest", "nearest failure")
    for seed in seeds:
        results = {}
        for method in METHODS:
            # Only what the guided search finds is brought near: at most 60 points and repeats more.
            more = {"then": ("nearest",), "confirm": 5} if method == "auto" else {}
            one = measure(case_of(seed, method, runs, **more), results)
            found[method].append(one)
            _row(method, seed, *_summary(one.answer))
    _title("medians")
    _row("method", "first", "failures", "smallest")
    medians = {method: _medians(several) for method, several in found.items()}
    for method, (first, failures, smallest) in medians.items():
        _row(method, f"{first:g}", f"{failures:g}", f"{smallest:.4f}")
    _, even, shallow = medians["halton"]
    _, guided, deep = medians["auto"]
    every = all(one.answer.first is not None for one in found["auto"])
    task = load_search_case(CAMPAIGN, NAME).task
    nearest = [one.answer.nearest for one in found["auto"] if one.answer.nearest is not None]
    changes = [len(changed_parameters(task, one.result.point)) for one in nearest]
    # Runs that other methods have executed are free: their CPU is reckoned as that of the others.
    executed = sum(one.answer.executed for several in found.values() for one in several)
    each = sum(one.runs for several in found.values() for one in several) / max(1, executed)
    total = [one.proposing / (each * runs) for one in found["auto"]]
    print(f"CPU of a run {each:.2f} s; of proposing, as a share of {runs} runs:")
    print("  " + ", ".join(f"{share:.1%}" for share in total), flush=True)
    return all(
        (
            _check("every seed of the guided search finds a failure", every),
            _check(
                f"guided finds {guided:g} failures, halton {even:g}: 1.5 times as many at least",
                guided >= 1.5 * even,
            ),
            _check(f"and a smaller margin: {deep:.4f} m, {shallow:.4f} m", deep < shallow),
            _check(
                f"nearest failures change {', '.join(map(str, changes))} parameters (<= 3)",
                bool(changes) and max(changes) <= 3,
            ),
            _check(
                f"proposing takes at most {max(total):.1%} of the CPU (< 5 %)", max(total) < 0.05
            ),
        )
    )


def _summary(answer):
    first = "–" if answer.first is None else answer.first.number
    nearest = "" if answer.nearest is None else answer.sentences[0]
    return first, answer.failed, _margin(answer), nearest


def _margin(answer):
    best = answer.best
    return "–" if best is None or best.value is None else f"{best.value.margin:.4f}"


def _medians(found):
    firsts = [float("inf") if m.answer.first is None else m.answer.first.number for m in found]
    best = [m.answer.best for m in found]
    margins = [one.value.margin for one in best if one is not None and one.value is not None]
    failed = median(m.answer.failed for m in found)
    return median(firsts), failed, median(margins) if margins else float("nan")


def show_found(runs):
    """Print that the found file, beside the layers, gives the very same failure."""
    _title("the found file alone")
    with _copied_campaigns() as campaigns:
        file = campaigns / "demo" / "campaign.yaml"
        case = load_search_case(file, NAME)
        task = replace(case.task, runs=runs, confirm=0, then=("nearest",), stop="failures")
        answer = run_search(replace(case, task=task), LocalRuns(slots=_SLOTS))
        if not answer.found:
            return _check(f"a failure within {runs} runs", False)
        found = file.parent / f"{NAME}.found.yaml"
        found.write_text(answer.found, encoding="utf-8")
        again = expand(load_campaign(found))
        spec, scene = again.runs[0], again.scenes[0]
        result = execute(spec, scene, trace_path=campaigns / "found.mcap")
        said = {verdict.oracle: verdict for verdict in result.verdicts}[task.minimise]
        print(f"  {answer.sentences[0]}")
        same = _check(
            f"its digest is {answer.told_failure.digest[:12]}",
            spec.digest == answer.told_failure.digest,
        )
        words = f"{task.minimise} is {said.outcome}, margin {said.margin} {said.unit}"
        return _check(words, said.outcome == "fail") and same


def show_same(runs):
    """Print whether the lists of runs are the same, whoever executes them and is killed."""
    _title(f"equal lists of runs, {runs} of them explored, by daemons")
    with tempfile.TemporaryDirectory(prefix="acceptance-") as folder:
        lists = {
            "one slot": _by_daemon(Path(folder) / "one", 1, runs),
            "four slots": _by_daemon(Path(folder) / "four", 4, runs),
            f"killed at every {_KILL_EVERY}th run": _by_daemon(
                Path(folder) / "killed", 2, runs, kill=True
            ),
        }
    expected = next(iter(lists.values()))
    for name, found in lists.items():
        same = "as the first" if found == expected else "DIFFERENT"
        print(f"  {name:<28} {len(found)} runs, {same}", flush=True)
    return _check("all lists are equal", all(found == expected for found in lists.values()))


def _by_daemon(state, slots, runs, *, kill=False):
    """Return positions and digests of a search by a real daemon with its own state."""

    def change(task):
        return replace(task, runs=runs, confirm=2, then=("nearest",))

    submission, case, _ = prepare_search(CAMPAIGN, NAME, client="acceptance", change=change)
    campaign = submission.campaign
    with daemon_at(state, slots, executor=DEFAULT_EXECUTOR, patience=30.0) as daemon:
        search = _begin(daemon, submission, case)
        kills = 0
        at = _KILL_EVERY
        while kill:
            _wait(daemon, campaign, at)
            if _row_of(daemon, campaign).ended:
                break
            # The daemon and the client of its search in turns.
            if kills % 2:
                daemon.kill()
                daemon.restart()
            else:
                search.kill()
                search.join()
                search = _begin(daemon, submission, case)
            kills, at = kills + 1, at + _KILL_EVERY
        _wait(daemon, campaign, 10**9)
        search.join()
        if kill:
            print(f"  killed {kills} times, client and daemon in turns", flush=True)
        row = _row_of(daemon, campaign)
        assert row.state == "finished", row.note
        with daemon.client() as client:
            return [
                (one.proposal.position, one.digest)
                for one in client.all_runs(campaign, results=True)
            ]


def _begin(daemon, submission, case):
    """Begin a search, or go on with it, in a process that can be killed."""
    daemon.client().close()  # as soon as it answers
    process = multiprocessing.get_context("spawn").Process(
        target=_run_client, args=(daemon.endpoint, submission, case)
    )
    process.start()
    return process


def _run_client(endpoint, submission, case):
    client = Client.open(endpoint, timeout=30.0)
    client.begin_search(submission)
    SearchClient(client, submission, lambda runs: run_search(case, runs)).run()


def _row_of(daemon, campaign):
    with daemon.client() as client:
        return client.search_row(campaign)


def _wait(daemon, campaign, runs):
    """Wait until a search has so many results, or has ended."""
    with daemon.client() as client:

        def reached():
            row = client.search_row(campaign)
            return row is not None and (row.ended or row.finished >= runs)

        eventually(reached, _PATIENCE)


def show_nothing():
    """Print what is said of a space in which nothing fails."""
    _title("a space without a failure: open-house, noise alone")
    with _copied_campaigns(searches=_HARMLESS) as campaigns:
        case = load_search_case(campaigns / "demo" / "campaign.yaml", "noise-only")
        answer = run_search(case, LocalRuns(slots=_SLOTS))
    for sentence in answer.sentences:
        print(f"  {sentence}")
    said = any("95 % certainty less than" in sentence for sentence in answer.sentences)
    ended = answer.ended == "budget" and answer.failed == 0
    return all((_check("it ends at its budget, nothing fails", ended), _check("says so", said)))


def show_flat():
    """Print how an oracle that cannot be followed is refused."""
    _title("a flat oracle")
    with _copied_campaigns(searches=_FLAT) as campaigns:
        try:
            prepare_search(campaigns / "demo" / "campaign.yaml", "flat")
        except InputError as error:
            # Where files were copied to says nothing.
            text = str(error).replace(f"{campaigns}{os.sep}", "")
            print("  " + text.replace("\n", "\n  "))
            return _check("it is refused with a better one", "min(clearance) >=" in text)
    return _check("it is refused", False)


@contextmanager
def _copied_campaigns(searches=""):
    """A copy of the campaigns for the block, the demonstration with more searches."""
    with tempfile.TemporaryDirectory(prefix="acceptance-") as folder:
        copy = shutil.copytree(ROOT / "campaigns", Path(folder) / "campaigns")
        file = copy / "demo" / "campaign.yaml"
        # Its searches are the last that it says.
        file.write_text(file.read_text("utf-8") + searches, "utf-8")
        yield copy


def _title(text):
    print(f"\n{text}", flush=True)


def _row(*cells):
    print("  " + "  ".join(f"{cell!s:<9}" for cell in cells).rstrip(), flush=True)


def _check(text, holds):
    print(f"  {'ok ' if holds else 'NOT'} {text}", flush=True)
    return holds


def main():
    """Show the parts that are named; 1 when one does not hold."""
    parts = {
        "flat": show_flat,
        "nothing": show_nothing,
        "found": lambda: show_found(options.runs),
        "same": lambda: show_same(options.daemon_runs),
        "methods": lambda: show_methods(range(options.seeds), options.runs),
    }
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(parts)}")
    parser.add_argument("--runs", type=int, default=60, help="budget of each search")
    parser.add_argument("--daemon-runs", type=int, default=60, help="budget of each by a daemon")
    parser.add_argument("--seeds", type=int, default=5, help="so many seeds, from 0 on")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(parts):
        parser.error(f"no part {', '.join(sorted(unknown))}: there are {', '.join(parts)}")
    held = [show() for name, show in parts.items() if name in (options.parts or parts)]
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())
