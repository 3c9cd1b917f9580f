"""Mutate, read and keep what fails.

``python -m tests.languages.fuzz [-n NUMBER] [--seed SEED] [LANGUAGE …]``

Each input is bounded in CPU time and the whole process in memory. Exit code 1 when anything failed.
"""

import argparse
import hashlib
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

from tests.languages.fuzz.mutation import mutated
from tests.languages.fuzz.targets import CORPUS, TARGETS, answer, prepare

_LIMIT = 20.0
"""Seconds of CPU an input may take: a slow machine needs a tenth for the slowest that is sound."""
_MEMORY = 4 << 30


class _TooSlow(BaseException):
    """Not an ``Exception``: nothing that is tested may take it for one of its own."""


def _stop(_, frame):
    raise _TooSlow("".join(traceback.format_stack(frame, 12)))


def fuzz(target, number, seed):
    """Read ``number`` mutated files of a language; return how many failed in which way."""
    failures = Counter()
    taken, slowest = 0, 0.0
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as name:
        folder = prepare(Path(name))
        kept = CORPUS / target.name
        seeds = [(folder / target.file).read_bytes()] * 4
        seeds += [file.read_bytes() for file in sorted(kept.glob("*"))]
        for index in range(number):
            rng = random.Random(f"{seed} {target.name} {index}")
            data = mutated(rng, seeds, rng.choice((1, 1, 2, 3, 5)))
            started = time.process_time()
            signal.setitimer(signal.ITIMER_PROF, _LIMIT)
            try:
                taken += answer(target, folder, data)
            except (Exception, _TooSlow) as error:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
                failures[_keep(target, data, error, kept)] += 1
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
            slowest = max(slowest, time.process_time() - started)
    took = time.process_time() - begin
    failed = sum(failures.values())
    print(
        f"{target.name:12} {number:6d} inputs {taken:6d} taken {failed:5d} failed"
        f" {took:7.1f} s, the slowest {slowest:.2f} s",
        flush=True,
    )
    return failures


def _keep(target, data, error, folder):
    """Print a failure the first time it is seen, and keep its input."""
    frames = traceback.extract_tb(error.__traceback__)
    place = " < ".join(f"{Path(f.filename).name}:{f.lineno}" for f in frames[-1:-4:-1])
    key = f"{type(error).__name__} {place}"
    name = hashlib.sha256(key.encode()).hexdigest()[:8] + Path(target.file).suffix
    if key not in _SEEN:
        _SEEN.add(key)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
        print(f"-- {target.name}/{name}: {key}\n   {ascii(str(error))[:400]}", flush=True)
        if isinstance(error, _TooSlow):
            print(error)
    return key


_SEEN = set()


def main():
    names = [target.name for target in TARGETS]
    reader = argparse.ArgumentParser(prog="python -m tests.languages.fuzz")
    reader.add_argument("-n", type=int, default=10_000, help="inputs of every language")
    reader.add_argument("--seed", type=int, default=0)
    reader.add_argument("language", nargs="*", choices=[*names, []], default=[])
    given = reader.parse_args()
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, most))
    signal.signal(signal.SIGPROF, _stop)
    wanted = [target for target in TARGETS if not given.language or target.name in given.language]
    failures = [fuzz(target, given.n, given.seed) for target in wanted]
    sys.exit(any(failures))


if __name__ == "__main__":
    main()
