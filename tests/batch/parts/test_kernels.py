"""Machine code on disk: it is used again, and not when something compiled into it has changed."""

import itertools
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from daemon.model import kernels
from daemon.model.kernels import cache_folder, compiling_ahead, kernel, machine_code
from tests.parts import ROOT, eventually

CALLEE = """
from daemon.model.kernels import kernel

LIMIT = {limit}

@kernel
def scaled(x):
    return {factor} * x
"""

CALLER = """
import callee
from callee import LIMIT, scaled
from daemon.model.kernels import kernel

@kernel
def by_name(x):
    return scaled(x) + LIMIT

@kernel
def by_module(x):
    return callee.scaled(x) + callee.LIMIT

for total in (by_name, by_module):
    print(total(10), sum(total.stats.cache_hits.values()))
"""

SLOW = """
from daemon.model.kernels import kernel

@kernel
def total(x):
    result = 0.0
    for k in range(x):
        result += k
    return result

print(total(4), len(total.stats.cache_hits))
"""


FORKING = """
import json, os, runpy, sys
import numba
from daemon.supervision import child

for line in sys.stdin:
    folder, output = json.loads(line)
    if os.fork() == 0:
        os.environ["NUMBA_CACHE_DIR"] = folder + "/cache"
        sys.path.insert(0, folder)
        with open(output + ".part", "w") as sys.stdout:
            runpy.run_path(folder + "/program.py", run_name="__main__")
        os.rename(output + ".part", output)
        os._exit(0)
"""


@pytest.fixture(scope="module")
def forking():
    """A process with numba, which takes a second to load."""
    command, pipes = [sys.executable, "-B", "-c", FORKING], {"stdin": subprocess.PIPE}
    with subprocess.Popen(command, cwd=ROOT, text=True, **pipes) as process:
        yield process.stdin
        process.stdin.close()


@pytest.fixture
def start(forking, tmp_path):
    """Start a program that keeps machine code in a folder of its own; returns its output."""
    numbers = itertools.count()

    def start(program=SLOW):
        output = tmp_path / f"output-{next(numbers)}"
        (tmp_path / "program.py").write_text(program)
        print(json.dumps([str(tmp_path), str(output)]), file=forking, flush=True)
        return output

    return start


def words_of(output):
    eventually(output.exists)
    return output.read_text().split()


def test_a_kernel_is_compiled_anew_when_what_it_calls_or_a_constant_changed(start, tmp_path):
    for factor, limit, expected in (
        (2, 1, "21 0 21 0"),
        (2, 1, "21 1 21 1"),
        (3, 1, "31 0 31 0"),
        (3, 5, "35 0 35 0"),
    ):
        (tmp_path / "callee.py").write_text(CALLEE.format(factor=factor, limit=limit))
        assert words_of(start(CALLER)) == expected.split()


def test_processes_that_call_one_kernel_compile_it_once(start, tmp_path):
    both = [start() for _ in range(2)]
    assert sorted(map(words_of, both)) == [["6.0", "0"], ["6.0", "1"]]
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 1
    # An index that cannot be read is written anew: as of a class that has moved.
    (index,) = (tmp_path / "cache").rglob("*.nbi")
    index.write_bytes(index.read_bytes().replace(b"numba.core.types", b"numba.gone.types"))
    assert words_of(start()) == ["6.0", "0"]
    assert words_of(start()) == ["6.0", "1"]


def test_a_kernel_is_compiled_where_nothing_can_be_kept(start, tmp_path):
    (tmp_path / "cache").write_text("no folder")
    assert words_of(start()) == ["6.0", "0"]


def test_machine_code_lies_beside_the_sources_unless_another_folder_is_named(monkeypatch, tmp_path):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    assert cache_folder().is_relative_to(Path(kernels.__file__).parents[1])
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert cache_folder().parent == tmp_path


def test_a_read_only_installation_without_a_home_uses_the_state_directory(monkeypatch, tmp_path):
    unwritable = (Path(kernels.__file__).parents[1], tmp_path / "home")

    def access(path, mode):
        return not any(Path(path).is_relative_to(folder) for folder in unwritable)

    monkeypatch.setattr(os, "access", access)
    (tmp_path / "home").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    assert cache_folder().parent == tmp_path / "state"


@kernel
def shifted(values, by):
    return values[0] + by


def test_machine_code_answers_as_its_kernel_for_other_values_of_the_same_types():
    direct = machine_code(shifted, np.ones(3), 1.0)
    for by in (0.5, -2.0):
        assert direct(2.0 * np.ones(4), by) == shifted(2.0 * np.ones(4), by) == 2.0 + by


def test_a_list_names_also_kernels_that_were_called_before(tmp_path):
    shifted(np.ones(3), 1.0)
    with compiling_ahead(lambda: None) as called:
        shifted(np.ones(3), 1.0)
        assert [name for _, name, _ in called()].count("shifted") == 1


AHEAD = """
import os
from daemon.model.kernels import compiling_ahead, machine_code
told = []
with compiling_ahead(lambda: told.append(1)) as called:
    ready = machine_code(total, 4)
    os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOWAIT)
    print(len(total.signatures), ready(4), len(told), len(called()))
"""


def test_machine_code_is_compiled_by_a_process_of_its_own_while_somebody_asks_for_that(start):
    # A call before the process has the lock compiles the kernel itself; so the call waits here.
    program = SLOW.replace("print(total(4), len(total.stats.cache_hits))", AHEAD)
    assert words_of(start(program)) == ["0", "6.0", "0", "1"]
