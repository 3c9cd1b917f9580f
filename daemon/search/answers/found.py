"""Files that a search leaves: the failing scenario as a campaign, and its world for Gazebo."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Final

from daemon.analysis.campaign_worlds import worlds_of_campaign
from daemon.campaign import load_campaign
from daemon.model.search_answer import SearchAnswer
from grammars.text.files import write_atomically
from grammars.text.sources import recording_reads, shipped_folder
from templates.artefacts import ExportResult, export
from templates.naming import file_name

_FOUND_ENDING: Final = ".found.yaml"
GAZEBO_KINDS: Final = ("map", "sdf", "keyframes", "tasks", "launch")
"""Parts of a world in Gazebo: models and world, doors that move, waypoints, launch files and the
map that these give to the map server."""


def found_name(task: str) -> str:
    """Return the name of the file with the found scenario of a search."""
    return f"{file_name(task)}{_FOUND_ENDING}"


def write_found(answer: SearchAnswer, name: str, folder: Path) -> Path:
    """Write the found scenario of search ``name`` and return its file.

    It names its layers as the campaign does, so ``folder`` is the one of the campaign. Raises
    ``OSError``.
    """
    path = folder / found_name(name)
    write_atomically(path, answer.found.encode("utf-8"))
    return path


def copy_campaign(path: Path, folder: Path) -> Path:
    """Copy the files that a campaign is made of below ``folder``; return its folder there.

    They lie to each other as they do, shipped layers beside the campaign, where it looks first.
    Raises :class:`grammars.text.diagnostics.InputError`, and ``OSError``.
    """
    # Its folder without links: ".." of a link leads elsewhere than its text says.
    file = path.parent.resolve() / path.name
    with recording_reads() as read:
        load_campaign(file)
    places = {Path(os.path.normpath(one.absolute())) for one in (file, *read)}
    shipped = shipped_folder()
    # In a checkout the shipped campaigns are files like others.
    own = file.parent.is_relative_to(shipped)
    ships = {place for place in places if not own and place.is_relative_to(shipped)}
    root = os.path.commonpath([place.parent for place in places - ships])
    beside = folder / file.parent.relative_to(root)
    for place in places:
        target = (
            beside / place.relative_to(shipped)
            if place in ships
            else folder / place.relative_to(root)
        )
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(place, target)
    return beside


def export_found(file: Path, folder: Path) -> ExportResult:
    """Export a found scenario for Gazebo: map, world, doors, tasks, launch files.

    Same file, same bytes. Raises :class:`grammars.text.diagnostics.InputError` for a file that
    cannot be used, and ``OSError``.
    """
    worlds, _ = worlds_of_campaign(file, repeats=1)
    return export(worlds[0], GAZEBO_KINDS, folder)
