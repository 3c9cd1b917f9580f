"""What an installation is made of, and that our short names mean ours wherever it is used."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from daemon.model.execution import python_command
from scenario_tui._own_packages import OWN_PACKAGES
from tests.parts import ROOT

EXTRAS = {
    "PIL": "cad",
    "distributed": "dask",
    "ezdxf": "cad",
    "foxglove": "foxglove",
    "pandas": "test",
    "pyte": "test",
    "pytest": "test",
    **dict.fromkeys(("aiohttp", "aiohttp_jinja2", "textual_serve"), "web"),
}
"""Libraries that modules import which are loaded only where an extra is asked for.

The plug-in of pytest is loaded by pytest alone; of pandas there are only types; pyte reads the
recording of a terminal for a picture of the documentation.
"""
_IMPORT = re.compile(r"^ *(?:import (\w+)[\w., ]*|from (\w+)[\w.]* import .*)$", re.M)
FOREIGN = "raise SystemExit('somebody else')"


@pytest.fixture(scope="module")
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))


def names(requirements):
    return {re.split(r"[\[>=<;]", text)[0].lower().replace("_", "-") for text in requirements}


def imported(folder):
    """Return the first names of everything modules import, wherever in them it stands."""
    texts = (path.read_text("utf-8") for path in folder.rglob("*.py"))
    return {name for text in texts for pair in _IMPORT.findall(text) for name in pair if name}


def test_what_is_imported_is_declared_and_nothing_else(project):
    rooms = [ROOT / name for name in (*OWN_PACKAGES, "scenario_tui")]
    modules = set().union(*(imported(room) for room in rooms))
    theirs = modules - set(sys.stdlib_module_names) - {room.name for room in rooms}
    # Of a ROS 2 installation: imported by the relay, which runs there.
    theirs -= {"rclpy", "rosidl_runtime_py", "tf2_msgs", "rosgraph_msgs", "builtin_interfaces"}
    declared = names(project["project"]["dependencies"])
    optional = project["project"]["optional-dependencies"]
    owners = packages_distributions()
    # Parts of pydantic and of jinja2, whose faces lead to them.
    theirs -= {"pydantic_core", "markupsafe"}
    used = set()
    for module in theirs:
        if module in owners:
            owner = {name.lower().replace("_", "-") for name in owners[module]}
            extra = EXTRAS.get(module)
            expected = names(optional[extra]) if extra else declared
            assert owner & expected, f"{module} of {owner} is not declared"
            used |= owner
    # Imported by optuna, which does not require it.
    declared -= {"cmaes"}
    assert declared <= used, declared - used


def test_our_packages_are_installed_below_one_name(project):
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert set(wheel["only-include"]) == {*OWN_PACKAGES, "scenario_tui"}
    places = {name: f"scenario_tui/_import_root/{name}" for name in OWN_PACKAGES}
    assert wheel["sources"] == places | {"scenario_tui/entry_points": ""}
    assert (ROOT / "scenario_tui" / "import_root.pth").read_text() == "scenario_tui/_import_root\n"


@pytest.fixture
def installed(tmp_path):
    """A folder like that of installed packages, with ours and with others of their names."""
    site = tmp_path / "site"
    shutil.copytree(
        ROOT / "scenario_tui", site / "scenario_tui", ignore=shutil.ignore_patterns("__pycache__")
    )
    root = site / "scenario_tui" / "_import_root"
    root.mkdir()
    for name in OWN_PACKAGES:
        (root / name).symlink_to(ROOT / name)
        (site / name).mkdir()
        (site / name / "__init__.py").write_text("whose = 'theirs'\n")
    return site


def run(command, where, *folders):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, folders))}
    return subprocess.run(command, cwd=where, env=environment, capture_output=True, text=True)


def test_names_mean_ours_whoever_else_has_them(installed, tmp_path):
    program = f"import scenario_tui, {', '.join(OWN_PACKAGES)}\n"
    program += f"print(*(m.__file__ for m in ({', '.join(OWN_PACKAGES)})), sep='\\n')"
    done = run([sys.executable, "-c", program], tmp_path, installed)
    root = installed / "scenario_tui" / "_import_root"
    assert done.stdout.split() == [str(root / name / "__init__.py") for name in OWN_PACKAGES]
    theirs = run([sys.executable, "-c", "import daemon; print(daemon.whose)"], tmp_path, installed)
    assert theirs.stdout == "theirs\n"


def test_a_name_that_is_taken_already_is_said_with_whose_it_is(installed, tmp_path):
    done = run([sys.executable, "-c", "import daemon, scenario_tui"], tmp_path, installed)
    assert f"{installed}/daemon/__init__.py was imported as 'daemon' before" in done.stderr
    assert "import scenario_tui first" in done.stderr


def test_commands_and_children_are_ours_whatever_pythonpath_says(tmp_path):
    """With an empty entry, too, which stands for the current folder."""
    for name in OWN_PACKAGES:
        (tmp_path / f"{name}.py").write_text(FOREIGN)
    serving = python_command("-m", "daemon", "serve", '{"state": "/dev/null"}')
    done = run(serving, tmp_path, Path(), tmp_path)
    assert (done.returncode, "choose another directory" in done.stderr) == (3, True), done.stderr
    program = Path(sys.executable).with_name("scenario")
    plan = str(ROOT / "campaigns" / "demo" / "flat.fpm")
    done = run([str(program), "check", plan], tmp_path, Path(), tmp_path)
    said = f"{plan}: floor plan with 4 spaces, 18 walls, 4 openings, no problems\n"
    assert (done.returncode, done.stderr) == (0, said)
