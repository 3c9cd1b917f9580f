"""Machine code on disk: it is used again, and not when something compiled into it has changed."""

import os
import subprocess
import sys
from pathlib import Path

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
    root = str(Path(__file__).parents[3])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([root, str(tmp_path)])}
    environment.pop("NUMBA_CACHE_DIR", None)

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
