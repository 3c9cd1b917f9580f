"""The recipes of docs/build-servers.md, executed as shell: in a small campaign, without servers.

``pip`` is a stand-in that takes the one line it should get; ``scenario`` is this checkout's.
"""

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
CAMPAIGN = """\
campaign: recipe
seed: 1
repeats: 1
limit: 3 min
robot: courier
oracles: navigation
matrix: {sut: [pilot]}
scenarios:
  house: {floorplan: flat, mission: courier, objects: doors, behaviours: BEHAVIOURS,
          oracles: [reached, no-contact, keeps-clear]}
"""


def recipe(title):
    text = (ROOT / "docs" / "build-servers.md").read_text("utf-8")
    found = re.search(rf"^## {title}$.*?```yaml\n(.*?)```", text, re.DOTALL | re.MULTILINE)
    assert found is not None
    return yaml.safe_load(found[1])


def repository(folder, behaviours):
    """A repository with a campaign of one run, and the programs a build finds."""
    shutil.copytree(ROOT / "campaigns", folder / "campaigns")
    place = folder / "campaigns" / "demo"
    (place / "campaign.yaml").write_text(CAMPAIGN.replace("BEHAVIOURS", behaviours))
    programs = folder / "programs"
    programs.mkdir()
    (programs / "pip").write_text('#!/bin/sh\n[ "$*" = "install scenario-tui" ]\n')
    (programs / "pip").chmod(0o755)
    (programs / "scenario").symlink_to(Path(sys.executable).with_name("scenario"))
    return place


def shell(line, place):
    path = f"{place.parents[1] / 'programs'}{os.pathsep}{os.environ['PATH']}"
    command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", line]
    environment = os.environ | {"PATH": path}
    done = subprocess.run(
        command, cwd=place, env=environment, capture_output=True, text=True, check=False
    )
    print(line, done.stdout, done.stderr)
    return done.returncode


def results(place):
    assert (place / "report.html").stat().st_size > 10_000
    return ET.parse(place / "results.xml").getroot()


def test_what_github_runs_is_green_when_all_is_as_expected(tmp_path):
    place = repository(tmp_path, "doors_open")
    found = recipe("GitHub Actions")
    assert isinstance(found, dict)
    steps = found["jobs"]["navigation"]["steps"]
    codes = [shell(step["run"], place) for step in steps if "run" in step]
    assert codes == [0, 0, 0, 0]
    suite = results(place).find("testsuite")
    assert suite is not None
    assert suite.get("failures") == "0"
    assert float(suite.get("time", "")) > 0.0
    uploaded = steps[-1]["with"]["path"].split()
    assert all(any(place.glob(pattern)) for pattern in uploaded)


def test_what_gitlab_runs_is_red_when_something_fails(tmp_path):
    place = repository(tmp_path, "doors_in_your_face")
    found = recipe("GitLab")
    assert isinstance(found, dict)
    job = found["navigation"]
    assert [shell(line, place) for line in job["script"]] == [0, 0, 1]
    assert [shell(line, place) for line in job["after_script"]] == [0]
    root = results(place)
    assert int(root.get("failures", "0")) > 0
    kept = [*job["artifacts"]["paths"], job["artifacts"]["reports"]["junit"]]
    assert all((place / name).exists() for name in kept)
    assert next((place / "results").glob("*.mcap")).is_file()


@pytest.mark.parametrize("title", ["GitHub Actions", "GitLab"])
def test_recipes_name_no_version_that_is_not_ours(title):
    versions = re.findall(r"python(?:-version)?['\"]?: ?['\"]?(\d+\.\d+)", str(recipe(title)))
    assert all(version in ("3.11", "3.12", "3.13") for version in versions)
