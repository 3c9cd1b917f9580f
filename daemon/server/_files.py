"""Files of systems under test: taken from whoever submits, given to workers, by digest."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.errors import Refused, Troubled
from daemon.ledger import Reader
from daemon.messages import FetchFile, Keep, Piece, Received
from daemon.places import Places
from daemon.server._journal import Journal
from daemon.store import accept_part, add_part, packed, read_part, size_of, unpacked

_MOST: Final = 4096
"""Files kept, those under way included."""


@dataclass(frozen=True, slots=True)
class Files:
    """The files there are; used in one thread."""

    places: Places
    journal: Journal

    def take(self, _: Reader, keep: Keep) -> Received:
        """Add a part to a file, whoever sends it; the answer says where to go on.

        Raises :class:`Troubled` while there is no room.
        """
        whole = self.places.files / keep.sha256
        if whole.exists():
            return Received(keep.size, complete=True)
        part = self.places.files / f".{keep.sha256}.part"
        problem = self._add(part, keep) if keep.data else ""
        if not problem and size_of(part) == keep.size:
            return self._finish(part, whole, keep)
        return Received(size_of(part), complete=False, problem=problem)

    def _add(self, part: Path, keep: Keep) -> str:
        if keep.offset != size_of(part):
            return f"the part begins at {keep.offset}, expected is {size_of(part)}"
        try:
            data = unpacked(keep.data, keep.digest)
        except ValueError as error:
            return str(error)
        if keep.offset + len(data) > keep.size:
            # Somebody else has announced another size: whose it was not begins again.
            part.unlink(missing_ok=True)
            raise Refused(f"there are more bytes than the {keep.size} announced")
        if keep.offset == 0 and sum(1 for _ in self.places.files.iterdir()) >= _MOST:
            raise Troubled(f"{_MOST} files are kept already: remove some in {self.places.files}")
        if shortage := self.places.shortage():
            raise Troubled(shortage)
        try:
            add_part(part, keep.offset, data)
        except OSError as error:
            raise Troubled(f"the file cannot be written: {error}") from error
        return ""

    def _finish(self, part: Path, whole: Path, keep: Keep) -> Received:
        if not accept_part(part, whole, keep.sha256, mode=0o400):
            return Received(0, complete=False, problem="the whole has another digest: begin again")
        self.journal.write("file received", sha256=keep.sha256, bytes=keep.size)
        return Received(keep.size, complete=True)

    def piece(self, _: Reader, fetch: FetchFile) -> Piece:
        """Return a part of a file; refuses for one that is not here."""
        path = self.places.files / fetch.sha256
        try:
            data = read_part(path, fetch.offset, fetch.count)
            size = path.stat().st_size
        except OSError as error:
            raise Refused(f"there is no file {fetch.sha256}") from error
        return Piece(fetch.offset, size, fetch.sha256, *packed(data))
