"""Try every published robot and print the table of ``docs/ros1.md``.

``SCENARIO_REFERENCE_DATA=FOLDER python -m campaigns.studies.published_robots [NAME ...]``
expects the packages in FOLDER/robots. Everything is done through the command line, as a user would.
"""

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from campaigns.studies.published_robots.folder import SUTS, robot_of, write_campaign


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one robot: whether it loads, its two runs, what was said first."""

    name: str
    loads: bool
    flat: str
    corridor: str
    said: str


def scenario(*arguments, cwd):
    """Run the command line of this environment."""
    command = [str(Path(sys.executable).with_name("scenario")), *arguments]
    environment = {**os.environ, "COLUMNS": "400", "NO_COLOR": "1"}
    return subprocess.run(
        command, cwd=cwd, capture_output=True, text=True, check=False, env=environment
    )


def outcome_of(name, packages, folder):
    """Load and run one robot."""
    campaign = write_campaign(folder, name, packages)
    checked = scenario("check", campaign.name, cwd=folder)
    # Problems are told on the stream of errors.
    told = (checked.stderr + checked.stdout).splitlines()
    complaints = [line.replace(f"{packages}/", "") for line in told]
    if checked.returncode != 0:
        return Outcome(name, False, "", "", "\n".join(complaints))
    ran = scenario("run", campaign.name, "--json", "-o", f"traces-{name}", cwd=folder)
    try:
        runs = json.loads(ran.stdout)
    except ValueError:
        return Outcome(name, True, "?", "?", ran.stderr)
    ends = {cell["scenario"]: cell for cell in runs["assessment"]["cells"]}
    said = "\n".join(line for line in complaints if "warning" in line)
    return Outcome(name, True, _told(ends["flat"]), _told(ends["corridor"]), said)


def _told(cell):
    red = [o["oracle"] for o in cell["oracles"] if o["failed"] or o["errors"] or o["missing"]]
    return ": ".join(part for part in (cell["verdict"], ", ".join(red)) if part)


def main(names):
    """Print a row for each robot, of all robots without names."""
    packages = Path(os.environ["SCENARIO_REFERENCE_DATA"]) / "robots"
    known = sorted(path.stem for path in SUTS.glob("*.yaml"))
    folder = Path(tempfile.mkdtemp(prefix="published-robots-"))
    print(f"traces in {folder}\n")
    print("| robot | description | loads | flat | corridor |\n|---|---|---|---|---|")
    said = []
    for name in names or known:
        outcome = outcome_of(name, packages, folder)
        loads = "yes" if outcome.loads else "no"
        row = (name, robot_of(name), loads, outcome.flat, outcome.corridor)
        print(f"| {' | '.join(row)} |", flush=True)
        said.append((name, outcome.said))
    for name, text in said:
        print(f"\n== {name}\n{text}")


if __name__ == "__main__":
    main(sys.argv[1:])
