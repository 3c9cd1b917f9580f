"""What a search leaves for others: the failing scenario as a campaign, and its world for Gazebo."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from daemon.analysis.campaign_worlds import worlds_of_campaign
from daemon.model.search_answer import SearchAnswer
from grammars.text.files import write_atomically
from templates.artefacts import ExportResult, export_worlds
from templates.naming import file_name

FOUND_ENDING: Final = ".found.yaml"
GAZEBO_KINDS: Final = ("map", "sdf", "keyframes", "tasks", "launch")
"""What a world in Gazebo is made of: models and world, doors that move, waypoints, launch files
and the map that these give to the map server."""


def found_file(name: str, folder: Path) -> Path:
    """Return where the found scenario of a search is written."""
    return folder / f"{file_name(name)}{FOUND_ENDING}"


def write_found(answer: SearchAnswer, name: str, folder: Path) -> Path:
    """Write the found scenario of search ``name`` and return its file.

    It names its layers as the campaign does, so ``folder`` is the one of the campaign. Raises
    ``ValueError`` when nothing was found, and ``OSError``.
    """
    if not answer.found:
        raise ValueError(f"{name} has found no failure")
    path = found_file(name, folder)
    write_atomically(path, answer.found.encode("utf-8"))
    return path


def export_found(file: Path, folder: Path) -> ExportResult:
    """Make of a found scenario what runs it in Gazebo: map, world, doors, tasks, launch files.

    Same file, same bytes. Raises :class:`grammars.text.diagnostics.InputError` for a file that
    cannot be used, and ``OSError``.
    """
    worlds, _ = worlds_of_campaign(file, repeats=1)
    placed = [(world, folder) for world in worlds[:1]]
    (result,) = export_worlds(placed, GAZEBO_KINDS)
    return result
