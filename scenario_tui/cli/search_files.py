"""Files of a search in a folder: the failing scenario with its layers, its world, a page."""

from __future__ import annotations

import base64
import os
import shlex
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.analysis.campaign_worlds import worlds_of_campaign
from daemon.batch.errors import DaemonError
from daemon.campaign import load_campaign
from grammars.text.diagnostics import InputError, Severity
from grammars.text.files import write_atomically
from grammars.text.sources import recording_reads, shipped_folder
from scenario_tui.cli.output import report_findings
from scenario_tui.cli.search_report import search_material, write_search_page
from templates.artefacts import ExportResult, export
from templates.naming import file_name

if TYPE_CHECKING:
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import RunRow
    from daemon.model.verbs import DaemonClient

GAZEBO_KINDS: Final = ("map", "sdf", "keyframes", "tasks", "launch")
"""Parts of a world in Gazebo: models and world, doors that move, waypoints, launch files and the
map that these give to the map server."""
_LAYERS: Final = "campaign"
_GAZEBO: Final = "gazebo"
_SMALLEST: Final = "smallest"
_PAGE: Final = "report.html"


def write_search_files(
    daemon: DaemonClient,
    row: SearchRow,
    proposals: tuple[RunRow, ...],
    folder: Path,
    campaign: Path | None,
    *,
    gazebo: bool = True,
) -> dict[str, Path]:
    """Write what there is about a search that has ended into a folder; return it by its kind.

    ``found`` is the nearest failure as a campaign file. It stands where the searched ``campaign``
    stood among its layers, which are copied, so that the folder can be handed on; without that
    file here it is the one that was written before, if any. Other files are replaced.
    """
    written: dict[str, Path] = {}
    answer, name = row.answer, f"{file_name(row.task.name)}.found.yaml"
    if answer is None:
        return written
    if answer.found and campaign is not None:
        written["found"] = copy_campaign(campaign, folder / _LAYERS) / name
        write_atomically(written["found"], answer.found.encode("utf-8"))
        if gazebo and _export(written["found"], folder / _GAZEBO):
            written["gazebo"] = folder / _GAZEBO
    elif earlier := sorted((folder / _LAYERS).rglob(name)):
        written["found"] = earlier[0]
    if answer.shrunk is not None and answer.shrunk.files:
        written["smallest"] = _write_smallest(answer.shrunk.files, folder / _SMALLEST)
    named = {kind: str(path) for kind, path in written.items()}
    folder.mkdir(parents=True, exist_ok=True)
    material = search_material(daemon, row, proposals)
    write_search_page(material, folder / _PAGE, tuple(file_commands(named)))
    written["page"] = folder / _PAGE
    return written


def _export(found: Path, folder: Path) -> bool:
    """Export the found world; what keeps it from that is told and keeps nothing else."""
    try:
        export_found(found, folder)
    except InputError as error:
        report_findings(replace(one, severity=Severity.WARNING) for one in error.findings)
        return False
    return True


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


def _write_smallest(files: Mapping[str, str], folder: Path) -> Path:
    """Write the files of the least that fails, which are in base64; return its campaign file.

    Raises :class:`DaemonError` for paths that lead elsewhere: a daemon may be anybody's.
    """
    for name, data in files.items():
        target = folder / name
        if not target.resolve().is_relative_to(folder.resolve()):
            raise DaemonError(f"the daemon's files of the search are not written: {name}")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(base64.b64decode(data))
    return folder / "campaign.yaml"


def file_commands(written: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Return what can be done with the files that were written: commands and what they do."""
    if "found" in written:
        yield f"scenario run {shlex.quote(written['found'])}", "the found failure again, on its own"
    if "smallest" in written:
        yield f"scenario run {shlex.quote(written['smallest'])}", "the least of it that still fails"
    if "gazebo" in written:
        folder = shlex.quote(written["gazebo"])
        yield f"ls {folder}", "its world for Gazebo: map, models, doors, launch files"
