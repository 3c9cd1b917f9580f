"""What a search leaves in a folder: the found scenario with its layers, its world, a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Final

from daemon.campaign import checked_bundle

if TYPE_CHECKING:
    from daemon.model.search import BundledFile, ProposalRow, SearchRow
    from daemon.model.verbs import DaemonClient

PAGE: Final = "search.html"
_SHRUNK: Final = "smallest"


def write_search_files(
    daemon: DaemonClient,
    row: SearchRow,
    rows: tuple[ProposalRow, ...],
    folder: Path,
    *,
    gazebo: bool = True,
) -> dict[str, Path]:
    """Write what there is about a search that has ended into a folder; return it by its kind.

    ``found`` is the nearest failure as a campaign file. It stands where the searched one stood
    among its layers, which are copied, so that the folder can be handed on.
    """
    written: dict[str, Path] = {}
    answer = row.answer
    if answer is None:
        return written
    folder.mkdir(parents=True, exist_ok=True)
    if answer.found:
        bundle = daemon.bundle(row.campaign)
        _write_bundle(bundle.files, folder)
        file = folder / Path(bundle.file).parent / f"{row.task.name}.found.yaml"
        file.write_text(answer.found, encoding="utf-8")
        written["found"] = file
    if answer.shrunk is not None and answer.shrunk.files:
        _write_bundle(answer.shrunk.files, folder / _SHRUNK)
        written["smallest"] = folder / _SHRUNK / "campaign.yaml"
    return written


def _write_bundle(files: Sequence[BundledFile], folder: Path) -> None:
    """Write files below a folder in place of what was written there before.

    Raises ``ValueError`` for paths that lead elsewhere: a daemon may be anybody's.
    """
    for path, data in checked_bundle(files).items():
        target = folder.joinpath(*PurePosixPath(path).parts)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data)


def file_commands(written: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Return what can be done with the files that were written: commands and what they do."""
    if "found" in written:
        yield f"scenario run {written['found']}", "the found failure again, on its own"
    if "smallest" in written:
        yield f"scenario run {written['smallest']}", "the least of it that still fails"
