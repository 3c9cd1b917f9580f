"""Help and completion must not load what only some commands need."""

from __future__ import annotations

import subprocess
import sys

HEAVY = ("numba", "numpy", "pymunk", "textual", "zenoh", "pydantic", "textx", "rdflib", "shapely")


def _loaded_after(code: str) -> set[str]:
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}\nprint(*sys.modules, file=sys.stderr)"],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stderr.split())


def test_the_command_line_imports_nothing_heavy() -> None:
    loaded = _loaded_after("import scenario_tui.cli")
    assert loaded.isdisjoint(HEAVY)
    assert "rich.console" not in loaded


def test_help_imports_nothing_heavy_either() -> None:
    loaded = _loaded_after("from scenario_tui.cli.command_line import invoke\ninvoke(['--help'])")
    assert loaded.isdisjoint(HEAVY)


def test_completion_of_names_imports_nothing_heavy_either() -> None:
    pressed = """
import os
os.environ |= {"_SCENARIO_COMPLETE": "complete_bash", "COMP_WORDS": "scenario\\nreplay\\n",
               "COMP_CWORD": "2", "SCENARIO_STATE": "/nowhere"}
from scenario_tui.cli.command_line import invoke
invoke([])
"""
    loaded = _loaded_after(pressed)
    assert "daemon.batch.ledger.names" in loaded
    # typer itself checks what stands before the word with pydantic.
    assert loaded.isdisjoint(set(HEAVY) - {"pydantic"})
