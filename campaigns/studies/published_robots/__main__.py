"""Try every published robot and print the table of ``campaigns/studies/published-robots.md``.

``SCENARIO_REFERENCE_DATA=FOLDER python -m campaigns.studies.published_robots [NAME ...]``
expects the packages in FOLDER/robots. Like a user, it does everything through the command line.
"""

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from campaigns.studies.published_robots import SUTS, robot_of, write_campaign


@dataclass(frozen=True, slots=True)
class Outcome:
    """Outcome of one robot: whether it loads, its two runs, the findings of the check."""

    name: str
    loads: bool
    flat: str
    corridor: str
    findings: str


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
    # The command prints problems to standard error.
    lines = (checked.stderr + checked.stdout).replace(f"{packages}/", "").splitlines()
    if checked.returncode != 0:
        return Outcome(name, False, "", "", "\n".join(lines))
    ran = scenario("run", campaign.name, "--json", "-o", f"traces-{name}", cwd=folder)
    try:
        runs = json.loads(ran.stdout)
    except ValueError:
        return Outcome(name, True, "?", "?", ran.stderr)
    ends = {cell["scenario"]: cell for cell in runs["assessment"]["cells"]}
    warnings = "\n".join(line for line in lines if "warning" in line)
    return Outcome(name, True, _cell_text(ends["flat"]), _cell_text(ends["corridor"]), warnings)


def _cell_text(cell):
    red = [o["oracle"] for o in cell["oracles"] if o["failed"] or o["errors"] or o["missing"]]
    return ": ".join(part for part in (cell["verdict"], ", ".join(red)) if part)


def main(names):
    """Print a row for each robot in ``names``, by default for all robots."""
    packages = Path(os.environ["SCENARIO_REFERENCE_DATA"]) / "robots"
    all_names = sorted(path.stem for path in SUTS.glob("*.yaml"))
    folder = Path(tempfile.mkdtemp(prefix="published-robots-"))
    print(f"traces in {folder}\n")
    print("| robot | description | loads | flat | corridor |\n|---|---|---|---|---|")
    findings = []
    for name in names or all_names:
        outcome = outcome_of(name, packages, folder)
        loads = "yes" if outcome.loads else "no"
        row = (name, robot_of(name), loads, outcome.flat, outcome.corridor)
        print(f"| {' | '.join(row)} |", flush=True)
        findings.append((name, outcome.findings))
    for name, text in findings:
        print(f"\n== {name}\n{text}")


if __name__ == "__main__":
    main(sys.argv[1:])
