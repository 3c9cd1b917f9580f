"""What a search leaves in a folder: the found scenario, its world, the least of it, a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Final

from daemon.batch.errors import DaemonError
from daemon.campaign import checked_bundle
from daemon.search.found import export_found, write_found
from daemon.search.page import search_page
from grammars.text.diagnostics import InputError, Severity
from scenario_tui.cli.output import report_diagnostics
from scenario_tui.text.search_text import search_commands

if TYPE_CHECKING:
    from daemon.model.search import BundledFile, ProposalRow, SearchRow
    from daemon.model.verbs import DaemonClient

_PAGE: Final = "search.html"
_LAYERS: Final = "campaign"
_GAZEBO: Final = "gazebo"
_SMALLEST: Final = "smallest"


def write_search_files(
    daemon: DaemonClient,
    row: SearchRow,
    rows: Sequence[ProposalRow],
    folder: Path,
    *,
    gazebo: bool = True,
    traces: Mapping[str, Path],
) -> dict[str, Path]:
    """Write what there is about a search that has ended into a folder; return it by its kind.

    ``found`` is the nearest failure as a campaign file. It stands where the searched one stood
    among its layers, which are copied, so that the folder can be handed on. ``traces`` are those
    of runs that are here, for the pictures of the page. What was written there before is replaced.
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
    folder.mkdir(parents=True, exist_ok=True)
    written["page"] = folder / _PAGE
    commands = search_commands(row)
    page = search_page(row, rows, traces=traces, commands=commands)
    written["page"].write_text(page, encoding="utf-8")
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
        yield f"scenario run {written['found']}", "the found failure again, on its own"
    if "smallest" in written:
        yield f"scenario run {written['smallest']}", "the least of it that still fails"
    if "gazebo" in written:
        yield f"ls {written['gazebo']}", "its world for Gazebo: models, doors, tasks, launch files"
