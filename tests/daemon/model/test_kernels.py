"""Machine code on disk: it is used again, and not when something compiled into it has changed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CALLEE = """
from daemon.model.kernels import kernel

LIMIT = {limit}

@kernel
def scaled(x):
    return {factor} * x
"""

CALLER = """
from daemon.model.kernels import kernel
{imports}

@kernel
def total(x):
    return {scaled}(x) + {limit}

print(total(10), sum(total.stats.cache_hits.values()))
"""
NAMES = {"imports": "from callee import LIMIT, scaled", "scaled": "scaled", "limit": "LIMIT"}
MODULE = {"imports": "import callee", "scaled": "callee.scaled", "limit": "callee.LIMIT"}


@pytest.mark.parametrize("how", [NAMES, MODULE], ids=["names", "module"])
def test_a_kernel_is_compiled_anew_when_what_it_calls_or_a_constant_changed(
    tmp_path: Path, how: dict[str, str]
) -> None:
    callee, caller = tmp_path / "callee.py", tmp_path / "caller.py"
    caller.write_text(CALLER.format(**how))
    root = str(Path(__file__).parents[3])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([root, str(tmp_path)])}
    environment.pop("NUMBA_CACHE_DIR", None)

    def run(factor: int, limit: int) -> list[int]:
        callee.write_text(CALLEE.format(factor=factor, limit=limit))
        command = [sys.executable, "-B", str(caller)]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=120, check=True
        )
        return [int(word) for word in done.stdout.split()]

    assert run(2, 1) == [21, 0]
    assert run(2, 1) == [21, 1]
    assert run(3, 1) == [31, 0]
    assert run(3, 5) == [35, 0]
    assert run(3, 5) == [35, 1]
