"""Machine code on disk: it is used again, and not when something compiled into it has changed."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from daemon.model import kernels
from daemon.model.kernels import cache_folder, compiling_ahead, kernel, machine_code

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


def test_a_kernel_is_compiled_anew_when_what_it_calls_or_a_constant_changed(tmp_path):
    callee, caller = tmp_path / "callee.py", tmp_path / "caller.py"
    caller.write_text(CALLER)
    environment = environment_of(tmp_path)

    def run(factor, limit):
        callee.write_text(CALLEE.format(factor=factor, limit=limit))
        command = [sys.executable, "-B", str(caller)]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=120, check=True
        )
        return [int(word) for word in done.stdout.split()]

    assert run(2, 1) == [21, 0, 21, 0]
    assert run(2, 1) == [21, 1, 21, 1]
    assert run(3, 1) == [31, 0, 31, 0]
    assert run(3, 5) == [35, 0, 35, 0]


SLOW = """
import sys
from daemon.model.kernels import kernel

@kernel
def total(x):
    result = 0.0
    for k in range(x):
        result += k
    return result

print(total(4), len(total.stats.cache_hits))
"""


def environment_of(folder):
    """What a process needs that keeps machine code in a folder of its own."""
    paths = os.pathsep.join([str(Path(__file__).parents[3]), str(folder)])
    return os.environ | {"PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(folder / "cache")}


def test_processes_that_call_one_kernel_compile_it_once(tmp_path):
    script = tmp_path / "slow.py"
    script.write_text(SLOW)
    command = [sys.executable, "-B", str(script)]
    both = [
        subprocess.Popen(command, env=environment_of(tmp_path), stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    said = sorted(process.communicate(timeout=120)[0].split() for process in both)
    assert said == [["6.0", "0"], ["6.0", "1"]]
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 1


def test_a_kernel_is_compiled_where_nothing_can_be_kept(tmp_path):
    script = tmp_path / "slow.py"
    script.write_text(SLOW)
    (tmp_path / "cache").write_text("no folder")
    command = [sys.executable, "-B", str(script)]
    said = subprocess.check_output(command, env=environment_of(tmp_path), text=True, timeout=120)
    assert said.split() == ["6.0", "0"]


def test_an_index_that_cannot_be_read_is_written_anew(tmp_path):
    script = tmp_path / "slow.py"
    script.write_text(SLOW)
    command = [sys.executable, "-B", str(script)]

    def run():
        said = subprocess.check_output(
            command, env=environment_of(tmp_path), text=True, timeout=120
        )
        return said.split()

    assert run() == ["6.0", "0"]
    (index,) = (tmp_path / "cache").rglob("*.nbi")
    # As a class that has moved: its name leads nowhere.
    index.write_bytes(index.read_bytes().replace(b"numba.core.types", b"numba.gone.types"))
    assert run() == ["6.0", "0"]
    assert run() == ["6.0", "1"]


@pytest.fixture
def read_only(monkeypatch, tmp_path):
    """Folders below this one cannot be written, the installation among them."""
    real = os.access
    folders = (Path(kernels.__file__).parents[1], tmp_path / "home")
    monkeypatch.setattr(
        os,
        "access",
        lambda path, mode: (
            not any(Path(path).is_relative_to(f) for f in folders) and real(path, mode)
        ),
    )
    (tmp_path / "home").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)


def test_machine_code_lies_beside_the_sources_unless_another_folder_is_named(monkeypatch, tmp_path):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    assert cache_folder().is_relative_to(Path(kernels.__file__).parents[1])
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert cache_folder().parent == tmp_path


def test_a_read_only_installation_without_a_home_uses_the_state_directory(
    monkeypatch, tmp_path, read_only
):
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


def test_machine_code_is_compiled_by_a_process_of_its_own_while_somebody_asks_for_that(tmp_path):
    script = tmp_path / "slow.py"
    # A call before the process has the lock compiles the kernel itself; so the call waits here.
    ahead = """
import os
from daemon.model.kernels import compiling_ahead, machine_code
told = []
with compiling_ahead(lambda: told.append(1)) as called:
    ready = machine_code(total, 4)
    os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOWAIT)
    print(len(total.signatures), ready(4), len(told), len(called()))
"""
    script.write_text(SLOW.replace("print(total(4), len(total.stats.cache_hits))", ahead))
    command = [sys.executable, "-B", str(script)]
    said = subprocess.check_output(command, env=environment_of(tmp_path), text=True, timeout=120)
    assert said.split() == ["0", "6.0", "0", "1"]
