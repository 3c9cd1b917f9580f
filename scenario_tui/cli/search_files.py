"""What a search leaves in a folder: the found scenario with its layers, its world, a page."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Final

from daemon.batch.errors import DaemonError
from daemon.model.bundles import checked_bundle
from daemon.search.answers.found import export_found, write_found
from grammars.text.diagnostics import InputError, Severity
from scenario_tui.cli.output import report_diagnostics
from scenario_tui.cli.search_report import daemon_material, write_search_page

if TYPE_CHECKING:
    from daemon.model.proposals import ProposalRow
    from daemon.model.search import BundledFile
    from daemon.model.search_answer import SearchRow
    from daemon.model.verbs import DaemonClient

_LAYERS: Final = "campaign"
_GAZEBO: Final = "gazebo"
_SMALLEST: Final = "smallest"
_PAGE: Final = "report.html"


def write_search_files(
    daemon: DaemonClient,
    row: SearchRow,
    proposals: tuple[ProposalRow, ...],
    folder: Path,
    *,
    gazebo: bool = True,
) -> dict[str, Path]:
    """Write what there is about a search that has ended into a folder; return it by its kind.

    ``found`` is the nearest failure as a campaign file. It stands where the searched one stood
    among its layers, which are copied, so that the folder can be handed on. What was written there
    before is replaced.
    """
    written: dict[str, Path] = {}
    answer = row.answer
    if answer is None:
        return written
    if answer.found:
        bundle = daemon.bundle(row.campaign)
        place = _write_bundle(bundle.files, folder / _LAYERS, bundle.file)
        found = write_found(answer, row.task.name, place.parent)
        written["found"] = found
        if gazebo and _export(found, folder / _GAZEBO):
            written["gazebo"] = folder / _GAZEBO
    if answer.shrunk is not None and answer.shrunk.files:
        files = answer.shrunk.files
        written["smallest"] = _write_bundle(files, folder / _SMALLEST, "campaign.yaml")
    named = {kind: str(path) for kind, path in written.items()}
    folder.mkdir(parents=True, exist_ok=True)
    material = daemon_material(daemon, row, proposals)
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


def _write_bundle(files: Sequence[BundledFile], folder: Path, file: str) -> Path:
    """Write files below a folder in place of what was written there before; return one of them.

    Raises :class:`DaemonError` for paths that lead elsewhere: a daemon may be anybody's.
    """
    try:
        contents = checked_bundle(files)
    except ValueError as error:
        raise DaemonError(f"the daemon's files of the search are not written: {error}") from error
    if file not in contents:
        raise DaemonError(f"the daemon's files of the search have no {file}")
    for path, data in contents.items():
        target = folder.joinpath(*PurePosixPath(path).parts)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data)
    return folder.joinpath(*PurePosixPath(file).parts)


def file_commands(written: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Return what can be done with the files that were written: commands and what they do."""
    if "found" in written:
        yield f"scenario run {shlex.quote(written['found'])}", "the found failure again, on its own"
    if "smallest" in written:
        yield f"scenario run {shlex.quote(written['smallest'])}", "the least of it that still fails"
    if "gazebo" in written:
        folder = shlex.quote(written["gazebo"])
        yield f"ls {folder}", "its world for Gazebo: map, models, doors, launch files"
