"""Each tutorial, and each page about Python, is followed word by word in a folder of its own."""

import os
import runpy
import shlex
import sys

import pytest

from scenario_tui.cli import invoke
from tests.docs import examples, tutorials
from tests.docs.markdown import DOCS, ROOT, TUTORIALS

PAGES = (*sorted(TUTORIALS.glob("*.md")), DOCS / "library.md", DOCS / "tables.md")


# rdflib's own reader of JSON-LD makes graphs of a class that it calls deprecated.
@pytest.mark.filterwarnings("ignore:ConjunctiveGraph:DeprecationWarning")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_does_what_it_says(page, tmp_path, monkeypatch, capfd):
    folder = examples.make_folder(tmp_path).folder
    (folder / "campaigns").symlink_to(ROOT / "campaigns")
    monkeypatch.chdir(folder)
    monkeypatch.setenv("SCENARIO_STATE", str(tmp_path / "state"))
    monkeypatch.setattr(sys, "path", list(sys.path))
    paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    # What wraps lines depends on the width alone.
    monkeypatch.setenv("COLUMNS", "160")
    monkeypatch.delitem(sys.modules, "my_stack", raising=False)

    def run(command):
        program, *arguments = shlex.split(command)
        if program == "pip":
            tutorials.install(folder)
        elif program == "python":
            monkeypatch.setattr(sys, "argv", arguments)
            runpy.run_path(str(folder / arguments[0]))
        else:
            assert program == "scenario"
            invoke(arguments)
        said = capfd.readouterr()
        return said.out + said.err

    try:
        assert list(tutorials.follow(page, folder, run)) == []
    finally:
        if (tmp_path / "state").exists():
            run("scenario daemon --stop")
