"""Record the pictures of the documentation: ``python -m campaigns.studies.pictures``.

``docs/pictures`` contains every view of the dashboard and the output of the main commands, about a
small campaign that is executed for them; tests fail when they are out of date. ``docs/demo.svg`` is
the output of ``scenario demo``, ``docs/flat.svg`` the flat from ``scenario export``; ``--views``
skips these two, which are slow. ``--diagrams`` draws only the explaining pictures of the language
pages. ``--cast`` records only the first hour with the dashboard for asciinema,
``docs/pictures/first-hour.cast``, and makes the moving picture of it.
"""

import asyncio
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from rich.console import Console
from rich.text import Text

from campaigns.studies.pictures.diagrams import DIAGRAMS
from campaigns.studies.pictures.executed_campaign import execute_campaign
from campaigns.studies.pictures.moving_picture import MOVING, moving_svg
from campaigns.studies.pictures.session_cast import record_session
from campaigns.studies.pictures.shots import COMMANDS, FOLDER, KEYS, SHOTS, draw, key_table, typed

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs"
CAMPAIGN = ROOT / "campaigns" / "demo" / "campaign.yaml"
SCENARIO = Path(sys.executable).with_name("scenario")
WIDTH = 90


def record_demo():
    """Run the demo in an empty folder and write its output as a picture."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [SCENARIO, "demo"],
            cwd=folder,
            env=os.environ | {"FORCE_COLOR": "1", "COLUMNS": str(WIDTH), "LINES": "50"},
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            check=True,
        )
    with Path(os.devnull).open("w") as nowhere:
        console = Console(record=True, width=WIDTH, file=nowhere, force_terminal=True)
        console.print(Text("$ scenario demo\n") + Text.from_ansi(done.stdout))
    console.save_svg(str(DOCS / "demo.svg"), title="scenario demo")


def record_flat():
    """Draw the flat of the demo with its doors, mission and robot."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [SCENARIO, "export", CAMPAIGN, "picture", "-o", folder],
            stdout=subprocess.DEVNULL,
            check=True,
        )
        picture = Path(folder) / "busy-house" / "busy-house.svg"
        (DOCS / "flat.svg").write_text(picture.read_text())


def record_views():
    """Draw every view and type every command of the documentation, and list the keys."""
    document = DOCS / "dashboard.md"
    before, _, _ = document.read_text().partition(KEYS)
    document.write_text(before + KEYS + key_table())
    FOLDER.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as runs:
        executed = execute_campaign(Path(runs))
        for name in (*SHOTS, *COMMANDS):
            with tempfile.TemporaryDirectory() as place:
                folder = Path(place)
                svg = (
                    asyncio.run(draw(name, folder, executed))
                    if name in SHOTS
                    else typed(name, folder, executed)
                )
            (FOLDER / f"{name}.svg").write_text(svg)


def record_diagrams():
    """Draw the explaining pictures."""
    for name, draw_diagram in DIAGRAMS.items():
        (FOLDER / f"{name}.svg").write_text(draw_diagram(), "utf-8")


if __name__ == "__main__":
    if "--cast" in sys.argv[1:]:
        record_session()
        MOVING.write_text(moving_svg(), "utf-8")
        sys.exit()
    record_diagrams()
    if "--diagrams" in sys.argv[1:]:
        sys.exit()
    record_views()
    if "--views" in sys.argv[1:]:
        sys.exit()
    record_demo()
    record_flat()
