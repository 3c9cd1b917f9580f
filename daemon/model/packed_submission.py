"""A submission packed for the bus and the ledger: what its runs share is there once.

A run is a *cell* (everything that is the same for all repeats of a scenario with a system), a
*script* (what the doors and people do) and two numbers. A hundred thousand runs of building C are
630 MB when each is written out, and a few MB when packed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Final, NamedTuple, TypeAlias, get_type_hints

from pydantic import Field

from daemon.model.assessments import AssessmentRules
from daemon.model.spec import RunSpec
from daemon.model.status import CampaignOrigin, Submission
from grammars.model.behaviour import Behaviour
from grammars.model.scene import Scene
from grammars.text import codec

MOST_RUNS: Final = 200_000
"""Runs of a campaign, repeats in reserve included: they are entered in one transaction."""

Script: TypeAlias = tuple[Behaviour, ...]
_Index: TypeAlias = Annotated[int, Field(ge=0)]
_LISTS: Final = ("runs", "reserve")


class PackedRun(NamedTuple):
    """A run in terms of its cell and its script, by index."""

    cell: _Index
    script: _Index
    repeat: int
    seed: int


PackedRuns: TypeAlias = tuple[PackedRun, ...]


@dataclass(frozen=True, slots=True)
class PackedSubmission:
    """A :class:`Submission` on the bus; cells have no repeat, seed or script."""

    campaign: str
    name: str
    about: str
    source: str
    cells: tuple[RunSpec, ...]
    scripts: tuple[Script, ...]
    runs: PackedRuns
    scenes: tuple[Scene, ...]
    declared: AssessmentRules
    reserve: PackedRuns = ()
    fresh: bool = False
    origin: CampaignOrigin = field(default_factory=CampaignOrigin)


def too_many_runs(count: int) -> str:
    """Say that a campaign has more runs than it may have, and what to do."""
    return (
        f"the campaign has {count} runs, repeats in reserve included, and may have {MOST_RUNS}: "
        "split its scenarios among several campaigns"
    )


def cell_of(run: RunSpec) -> RunSpec:
    """The run without what tells it from the others of its cell."""
    return replace(run, repeat=0, seed=0, behaviours=())


class Interner:
    """Gives equal cells, and equal scripts, one number each, in order of appearance.

    What is the same object need not be written out to be known again, which makes it fast.
    """

    def __init__(self) -> None:
        self.cells: list[RunSpec] = []
        self.scripts: list[Script] = []
        self._known: dict[bytes, int] = {}
        self._seen: dict[tuple[object, ...], int] = {}
        # What is known by id() must not be freed: another object could get the same one.
        self._alive: list[object] = []

    def pack(self, run: RunSpec) -> PackedRun:
        """The run by numbers."""
        return PackedRun(self._cell(run), self._script(run.behaviours), run.repeat, run.seed)

    def _cell(self, run: RunSpec) -> int:
        # Runs of a campaign share these objects, so their ids are a key that costs nothing; kept
        # alive, because an id is that of something else when its object is gone.
        parts = (run.sut, run.robot, run.mission, run.oracles, run.map)
        plain = (run.campaign, run.scenario, run.scene, run.limit, run.engine)
        key = (*plain, *map(id, parts))
        if key not in self._seen:
            cell = cell_of(run)
            self._seen[key] = self._intern(codec.to_json(cell), cell, self.cells)
            self._alive.append(parts)
        return self._seen[key]

    def _script(self, script: Script) -> int:
        key = (id(script),)
        if key not in self._seen:
            text = codec.to_json(script, Script)
            self._seen[key] = self._intern(text, script, self.scripts)
            self._alive.append(script)
        return self._seen[key]

    def _intern(self, text: bytes, value: Any, kept: list[Any]) -> int:
        if text not in self._known:
            self._known[text] = len(kept)
            kept.append(value)
        return self._known[text]


def pack_submission(submission: Submission) -> PackedSubmission:
    """Put what the runs of a submission share into it once."""
    interner = Interner()
    runs = tuple(interner.pack(run) for run in submission.runs)
    reserve = tuple(interner.pack(run) for run in submission.reserve)
    same = (submission.campaign, submission.name, submission.about, submission.source)
    cells, scripts = tuple(interner.cells), tuple(interner.scripts)
    scenes, declared = submission.scenes, submission.declared
    about = (reserve, submission.fresh, submission.origin)
    return PackedSubmission(*same, cells, scripts, runs, scenes, declared, *about)


_VARYING: Final = frozenset({"repeat", "behaviours", "seed"})
"""Fields of a run that are not its cell's, in the order of their declaration."""


def _typed_fields(kind: type) -> tuple[tuple[str, bytes, Any], ...]:
    hints = get_type_hints(kind)
    names = [field.name for field in fields(kind)]
    return tuple((name, b'"%s":' % name.encode(), hints[name]) for name in names)


_RUN_FIELDS: Final = _typed_fields(RunSpec)
_SUBMISSION_FIELDS: Final = tuple(
    typed for typed in _typed_fields(Submission) if typed[0] != "origin"
)
"""Fields that make a submission the one it is: where it was written does not."""


class RunTexts:
    """The canonical JSON of packed runs, byte for byte what the codec makes of each ``RunSpec``.

    Put together from the texts of cells and scripts, each of which is written once: no run is ever
    made. Measured with the campaign of the paper, 6.4 kB a run, see ``tests/benchmarks``.
    """

    def __init__(self, packed: PackedSubmission) -> None:
        self._cells = [_chunks(cell) for cell in packed.cells]
        self._scripts = [codec.to_json(script, Script) for script in packed.scripts]

    def text(self, run: PackedRun) -> bytes:
        """The text of a run; raises ``ValueError`` for a number that stands for nothing."""
        cell, script, repeat, seed = run
        if cell >= len(self._cells) or script >= len(self._scripts):
            raise ValueError(f"there is no cell {cell} or no script {script} in the submission")
        head, middle, tail, end = self._cells[cell]
        return b"%b%d%b%b%b%d%b" % (head, repeat, middle, self._scripts[script], tail, seed, end)


def _chunks(cell: RunSpec) -> tuple[bytes, bytes, bytes, bytes]:
    """What stands before, between and behind the fields of a run that are not its cell's."""
    chunks, text = [], b"{"
    for i, (name, title, kind) in enumerate(_RUN_FIELDS):
        text += (b"," if i else b"") + title
        if name in _VARYING:
            chunks.append(text)
            text = b""
        else:
            text += codec.to_json(getattr(cell, name), kind)
    head, middle, tail = chunks
    return head, middle, tail, text + b"}"


def submission_digest(
    packed: PackedSubmission, each: Callable[[PackedRun, str], object] | None = None
) -> str:
    """Return what ``codec.digest`` says of the submission written out without its origin.

    ``each`` is called with every run (not those in reserve) and its digest, in order. Raises
    ``ValueError`` for a number that stands for nothing.
    """
    # Run by run into the hash, in the very form the codec gives the whole: all of it at once would
    # be the 630 MB that packing saves.
    texts, whole = RunTexts(packed), hashlib.sha256()
    for i, (name, title, kind) in enumerate(_SUBMISSION_FIELDS):
        whole.update((b"," if i else b"{") + title)
        if name in _LISTS:
            told = each if name == "runs" else None
            _update_with_runs(whole, texts, getattr(packed, name), told)
        else:
            whole.update(codec.to_json(getattr(packed, name), kind))
    whole.update(b"}")
    return whole.hexdigest()


def _update_with_runs(
    whole: Any,
    texts: RunTexts,
    runs: Iterable[PackedRun],
    each: Callable[[PackedRun, str], object] | None,
) -> None:
    whole.update(b"[")
    comma = b""
    for run in runs:
        text = texts.text(run)
        whole.update(comma)
        whole.update(text)
        comma = b","
        if each is not None:
            each(run, hashlib.sha256(text).hexdigest())
    whole.update(b"]")
