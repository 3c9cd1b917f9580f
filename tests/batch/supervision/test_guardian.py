"""The process above that of a run, with real processes."""

import faulthandler
import multiprocessing
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from daemon.supervision.guardian import end_guarded, guard
from daemon.supervision.output_file import OutputFile
from tests.fake_run import leave_process
from tests.parts import alive, eventually

ROOT = Path(__file__).parents[3]
CONTEXT = multiprocessing.get_context("fork")


def guarded(folder, run):
    faulthandler.disable()  # pytest's would tell of crashes that are meant
    guard(folder / "output")
    leave_process(folder / "left")
    (folder / "run").write_text(str(os.getpid()))
    run()


def left(folder):
    """What a run has left behind that is still there, and the run itself."""
    numbers = [*(folder / "left").read_text().split(), (folder / "run").read_text()]
    found = []
    for number in map(int, numbers):
        with suppress(psutil.NoSuchProcess):
            found.append(psutil.Process(number))
    return alive(found)


@pytest.mark.parametrize(
    ("run", "code"),
    [
        (lambda: None, 0),
        (lambda: os._exit(7), 7),
        (lambda: os.kill(os.getpid(), signal.SIGSEGV), -signal.SIGSEGV),
        (lambda: os.kill(os.getpid(), signal.SIGKILL), -signal.SIGKILL),
    ],
    ids=["returns", "exits", "crashes", "is killed"],
)
def test_it_ends_as_the_run_does_and_nothing_is_left(tmp_path, run, code):
    process = CONTEXT.Process(target=guarded, args=(tmp_path, run))
    process.start()
    process.join()
    assert process.exitcode == code
    assert left(tmp_path) == []


def test_a_run_is_ended_by_its_guardian(tmp_path):
    process = CONTEXT.Process(target=guarded, args=(tmp_path, signal.pause))
    process.start()
    eventually(lambda: (tmp_path / "run").exists())
    end_guarded(process)
    assert left(tmp_path) == []


def test_a_run_ends_with_who_has_started_it(tmp_path):
    program = (
        "import signal, sys\nfrom pathlib import Path\n"
        "from tests.batch.supervision.test_guardian import CONTEXT, guarded\n"
        "CONTEXT.Process(target=guarded, args=(Path(sys.argv[1]), signal.pause)).start()\n"
        "signal.pause()\n"
    )
    with subprocess.Popen([sys.executable, "-c", program, str(tmp_path)], cwd=ROOT) as holder:
        eventually(lambda: (tmp_path / "run").exists() and (tmp_path / "run").read_text())
        assert len(left(tmp_path)) == 3
        holder.kill()
    eventually(lambda: left(tmp_path) == [])


def print_much(last):
    for number in range(40):
        rest = f"{number:_>{2**20 - 1}}\n".encode()
        while rest:
            rest = rest[os.write(1, rest) :]
    os.write(1, f"{last}\n".encode())
    os.kill(os.getpid(), signal.SIGKILL)


def test_what_is_printed_is_bounded_and_its_end_survives_a_kill(tmp_path):
    words = "the last words"
    process = CONTEXT.Process(target=guarded, args=(tmp_path, lambda: print_much(words)))
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL
    assert (tmp_path / "output").stat().st_size <= 2**20
    found = OutputFile.read(tmp_path / "output")
    # Not compared as a whole: a megabyte of difference would be told.
    assert found[-30:].endswith(f"39\n{words}\n".encode())
    assert found.count(b" bytes left out ...]") == 1


def test_a_guardian_that_is_stopped_does_not_keep_a_run(tmp_path, monkeypatch):
    monkeypatch.setattr("daemon.supervision.guardian.KILL_LIMIT", 0.1)
    process = CONTEXT.Process(target=guard_and_wait, args=(tmp_path,))
    process.start()
    run = eventually(lambda: (tmp_path / "run").exists() and (tmp_path / "run").read_text())
    assert process.pid is not None
    os.kill(process.pid, signal.SIGSTOP)
    end_guarded(process)
    eventually(lambda: not psutil.pid_exists(int(run)) or not alive([psutil.Process(int(run))]))


def guard_and_wait(folder):
    guard()
    (folder / "run").write_text(str(os.getpid()))
    signal.pause()
