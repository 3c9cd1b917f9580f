"""What commands load: as little as they need, for people wait for every import."""

import inspect
import subprocess
import sys
from pathlib import Path

import pytest

from scenario_tui.cli import command_line
from scenario_tui.cli.commands import COMMANDS, load_command

NEEDED_BY_FEW = {
    "cmaes", "dask", "jinja2", "matplotlib", "mcap", "numba", "optuna", "pyarrow", "pymunk",
    "rdflib", "rosbags", "scipy", "sqlalchemy", "textual",
}  # fmt: skip
LANGUAGES = {"numpy", "shapely", "textx"}
BUS = {"zenoh", "cryptography"}
DEMO = "campaigns/demo/campaign.yaml"
LOADED = (
    # (words, exit code, what may not be loaded beside NEEDED_BY_FEW)
    ("--help", 0, LANGUAGES | BUS | {"pydantic"}),
    ("status", 3, LANGUAGES | BUS),
    ("results nothing", 2, LANGUAGES | BUS),
    ("search", 3, LANGUAGES),
    (f"check {DEMO}", 0, BUS | {"daemon.model.messages", "grammars.variation"}),
    ("check campaigns/ortega2024/campaign.yaml", 0, BUS),
    ("sut show campaigns/suts/a2s.yaml", 0, BUS),
    ("check campaigns/demo/flat.fpm", 0, BUS | {"daemon.campaign"}),
)
HEAVY = ("numba", "numpy", "pymunk", "textual", "zenoh", "pydantic", "textx", "rdflib", "shapely")


def _loaded_after(code):
    tell = "print(*sys.modules, file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}\nprint(file=sys.stderr)\n{tell}"],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stderr.splitlines()[-1].split())


def test_the_command_line_imports_nothing_heavy():
    loaded = _loaded_after("import scenario_tui.cli")
    assert loaded.isdisjoint(HEAVY)
    assert "rich.console" not in loaded


def test_help_imports_nothing_heavy_either():
    loaded = _loaded_after("from scenario_tui.cli.command_line import invoke\ninvoke(['--help'])")
    assert loaded.isdisjoint(HEAVY)


def test_no_command_imports_anything_heavy_before_it_runs():
    """Help and completion load a command, and print no more than its options."""
    loaded = _loaded_after(
        "from scenario_tui.cli.commands import COMMANDS, load_command\n"
        "for name in COMMANDS:\n    load_command(name)"
    )
    assert loaded.isdisjoint({*HEAVY, *NEEDED_BY_FEW, "rich.console", "daemon.model.status"})


def test_completion_of_names_imports_nothing_heavy_either():
    pressed = """
import os
os.environ |= {"_SCENARIO_COMPLETE": "complete_bash", "COMP_WORDS": "scenario\\nreplay\\n",
               "COMP_CWORD": "2", "SCENARIO_STATE": "/nowhere"}
from scenario_tui.cli.command_line import invoke
invoke([])
"""
    loaded = _loaded_after(pressed)
    assert "daemon.batch.ledger_names" in loaded
    # typer itself checks what stands before the word with pydantic.
    assert loaded.isdisjoint(set(HEAVY) - {"pydantic"})


@pytest.mark.parametrize(("words", "code", "unneeded"), LOADED)
def test_a_command_loads_no_more_than_it_needs(words, code, unneeded, monkeypatch, tmp_path):
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path))
    monkeypatch.delenv("SCENARIO_CONNECT", raising=False)
    monkeypatch.chdir(Path(command_line.__file__).parents[2])
    loaded = _loaded_after(
        "from scenario_tui.cli.command_line import invoke\n"
        f"assert invoke({words.split()!r}) == {code}"
    )
    assert not loaded & (NEEDED_BY_FEW | unneeded)


def test_who_submits_loads_nothing_that_reads_ledgers_and_traces():
    loaded = _loaded_after("import scenario_tui.library.job")
    assert loaded.isdisjoint({"daemon.batch.ledger", "daemon.trace", "mcap", "numpy"})


def test_the_first_screen_loads_nothing_that_only_answers_of_a_daemon_need():
    loaded = _loaded_after("""
import scenario_tui.cli.tui, scenario_tui.source, scenario_tui.dashboard.key_bindings
from pathlib import Path
from scenario_tui.dashboard.app import Dashboard
from scenario_tui.dashboard.config import read_config
from scenario_tui.dashboard.feed import Feed
Dashboard(Feed(None), config=read_config(Path("/nowhere/config.toml")))
""")
    unneeded = {"daemon.model.spec", "daemon.model.status", "numpy", "pydantic", "zenoh"}
    assert not loaded & ((NEEDED_BY_FEW | unneeded) - {"textual"})


@pytest.mark.parametrize(
    "code",
    [
        "import daemon.batch.server, daemon.batch.worker, daemon.run",
        "from scenario_tui.cli.command_line import invoke\n"
        "assert invoke(['check', 'campaigns/two_lasers/campaign.yaml']) == 0",
    ],
)
def test_who_never_searches_loads_nothing_that_searches(code, monkeypatch):
    monkeypatch.chdir(Path(command_line.__file__).parents[2])
    loaded = _loaded_after(code)
    assert not {name for name in loaded if name.startswith("daemon.search")}
    assert loaded.isdisjoint({"cmaes", "optuna", "sqlalchemy"})


def test_help_says_of_a_command_what_the_command_says():
    for name, (_, about) in COMMANDS.items():
        command = load_command(name)
        said = inspect.cleandoc(command.help or "").partition("\n\n")[0]
        assert about == " ".join(said.split()), name
        assert command.name == name


def test_a_command_leaves_without_a_word_of_its_libraries(tmp_path):
    pytest.importorskip("manifold3d")
    plan = Path(command_line.__file__).parents[2] / "campaigns" / "demo" / "flat.fpm"
    words = ["export", str(plan), "mesh", "-o", str(tmp_path)]
    code = f"from scenario_tui.cli import main\nmain({words!r})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "nanobind" not in done.stderr
    assert list(tmp_path.rglob("*.stl")) or list(tmp_path.rglob("*.dae"))
