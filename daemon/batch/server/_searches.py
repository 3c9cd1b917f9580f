"""What the daemon admits of searches: their files, and the runs that are added to them.

The files of a search are written into a folder for its owner alone, by names that lead nowhere
else.
"""

from __future__ import annotations

import filecmp
import shutil
import uuid
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from daemon.batch.errors import Refused, Unavailable
from daemon.batch.paths import StatePaths
from daemon.batch.server._dispatcher import read_request
from daemon.batch.server._submissions import admit_submission
from daemon.model.bundles import unpack_bundle
from daemon.model.ids import is_id
from daemon.model.proposals import ExtendRequest
from daemon.model.search import SearchSubmission
from daemon.model.verbs import EXTEND, SEARCH
from grammars.text import codec

_FILES: Final = "files"
_STAGED: Final = ".search.{}.tmp"


@dataclass(frozen=True, slots=True)
class StagedSearch:
    """A search that was admitted: ``asked`` without its files, which lie in ``folder``.

    ``digest`` is that of all of it, the files included.
    """

    asked: SearchSubmission
    digest: str
    folder: Path

    def place(self, paths: StatePaths, *, same: bool) -> None:
        """Put its files where those of the search belong, unless the ``same`` are there already.

        What should be the same may not be: somebody removed a file, or the power failed.
        """
        target = paths.search(self.asked.campaign)
        if same and _holds_all(target, self.folder / _FILES):
            return
        shutil.rmtree(target, ignore_errors=True)
        (self.folder / _FILES).rename(target)

    def remove(self) -> None:
        """Remove what was not placed."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _holds_all(folder: Path, wanted: Path) -> bool:
    """Whether each file below ``wanted`` is in ``folder`` as well, byte by byte."""
    return all(
        _is_same(folder / path.relative_to(wanted), path)
        for path in wanted.rglob("*")
        if path.is_file()
    )


def _is_same(one: Path, other: Path) -> bool:
    try:
        return filecmp.cmp(one, other, shallow=False)
    except OSError:
        return False


def stage_search(payload: bytes, paths: StatePaths) -> StagedSearch:
    """Check a search as it came and write its files into a folder, to be placed or removed.

    Raises :class:`Refused` with what is wrong, and :class:`Unavailable` when the disk is full, say.
    """
    folder = paths.searches / _STAGED.format(uuid.uuid4().hex[:8])
    try:
        folder.mkdir(mode=0o700)
        search = _read_search(payload)
        _unpack(search, folder)
        digest = codec.digest(replace(search, fresh=False))
        return StagedSearch(replace(search, files=()), digest, folder)
    except BaseException as error:
        shutil.rmtree(folder, ignore_errors=True)
        if isinstance(error, OSError):
            raise Unavailable(f"the search cannot be stored: {error}") from error
        raise


def _read_search(payload: bytes) -> SearchSubmission:
    search = read_request(SEARCH, payload)
    assert isinstance(search, SearchSubmission)
    if not is_id(search.campaign):
        words = f"{search.campaign!r} is not a campaign id: use up to 100 of A-Z a-z 0-9 _ -"
        raise Refused(words)
    if search.file not in {file.path for file in search.files}:
        raise Refused(f"the campaign file {search.file!r} is not among the files of the search")
    return search


def _unpack(search: SearchSubmission, folder: Path) -> None:
    try:
        unpack_bundle(search.files, folder / _FILES)
    except ValueError as error:
        raise Refused(f"the files of the search: {error}") from error


def remove_staged_searches(paths: StatePaths) -> None:
    """Remove what a daemon that was killed has left of searches it was reading."""
    for folder in paths.searches.glob(_STAGED.format("*")):
        shutil.rmtree(folder, ignore_errors=True)


def read_extension(payload: bytes, paths: StatePaths) -> ExtendRequest:
    """Check runs that are to be added to a search, and store their scenes.

    Raises as :func:`stage_search` does.
    """
    request = read_request(EXTEND, payload)
    assert isinstance(request, ExtendRequest)
    problems = list(_extension_problems(request))
    if problems:
        raise Refused("\n".join(problems[:10]))
    admit_submission(request.runs, paths)
    return request


def _extension_problems(request: ExtendRequest) -> Iterator[str]:
    proposals, runs = request.proposals, request.runs
    if runs.campaign != request.campaign:
        yield f"the runs are of {runs.campaign!r}, not of {request.campaign!r}"
    if len(runs.runs) != len(proposals) or runs.reserve:
        yield f"there are {len(runs.runs)} runs for {len(proposals)} proposals"
        return
    for place, (proposal, run) in enumerate(zip(proposals, runs.runs, strict=True)):
        if proposal.position != proposals[0].position + place:
            yield f"proposals follow one after the other, not at {proposal.position}"
        if min(proposal.position, proposal.number, proposal.repeat) < 0:
            yield f"proposals are counted from 0, not {proposal.position}"
        if proposal.repeat != run.repeat:
            yield f"repeat {run.repeat} was proposed as repeat {proposal.repeat}"
