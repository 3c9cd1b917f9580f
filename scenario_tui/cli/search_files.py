"""What a search leaves in a folder: the found scenario with its layers, its world, a page."""

from __future__ import annotations

import base64
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.batch.errors import DaemonError
from daemon.search.answers.found import (
    copy_campaign,
    export_found,
    found_name,
    write_found,
)
from grammars.text.diagnostics import InputError, Severity
from scenario_tui.cli.output import report_diagnostics
from scenario_tui.cli.search_report import search_material, write_search_page

if TYPE_CHECKING:
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import RunRow
    from daemon.model.verbs import DaemonClient

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
    answer = row.answer
    if answer is None:
        return written
    if answer.found and campaign is not None:
        beside = copy_campaign(campaign, folder / _LAYERS)
        written["found"] = write_found(answer, row.task.name, beside)
        if gazebo and _export(written["found"], folder / _GAZEBO):
            written["gazebo"] = folder / _GAZEBO
    elif earlier := sorted((folder / _LAYERS).rglob(found_name(row.task.name))):
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
        report_diagnostics(replace(one, severity=Severity.WARNING) for one in error.diagnostics)
        return False
    return True


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
