"""A run, before and after: the specification that identifies it and the result it leaves.

``RunSpec`` holds everything that decides the bytes of a trace. Same digest, same trace. For that,
versions have to be equal wherever runs are executed.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import Field

from daemon.model.attachments import FILES_PARAMETER, SutMissing, stored_file
from daemon.model.ranges import Centimetres, Moment, Seconds, SignalValue, WaypointCount
from daemon.model.verdicts import (
    LONGEST_EVIDENCE,
    Outcome,
    Verdict,
    join_notes,
    shorten_evidence,
)
from grammars.model.behaviour import Behaviour
from grammars.model.geometry import Pose2
from grammars.model.grid import MapRule
from grammars.model.mission import Mission
from grammars.model.robot import Robot
from grammars.text import codec

RunEnding: TypeAlias = Literal["finished", "limit", "crashed"]

Script: TypeAlias = tuple[Behaviour, ...]
"""The behaviours of all doors and people in a run."""

ENGINE_VERSION: Final = "6"
"""Raised whenever a change alters traces of unchanged specifications."""


@dataclass(frozen=True, slots=True)
class SutReference:
    """A configured system under test: its name in the campaign, its kind and its parameters.

    ``files`` are the digests of the files it needs, by name (:mod:`daemon.model.attachments`).
    One that lives outside of the simulator says so by the parameter ``repeatable: false``: same
    specification, same world and noise, but not the same answers.
    """

    name: str
    kind: str
    parameters: dict[str, Any]
    files: dict[str, Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]] = field(default_factory=dict)

    @property
    def repeatable(self) -> bool:
        """Whether a run of it leaves the same bytes whenever it is repeated."""
        return self.parameters.get("repeatable") is not False

    @property
    def recorded(self) -> tuple[str, ...]:
        """Reports that its runs record (:data:`~daemon.model.stack_reports.REPORT_TOPICS`)."""
        names = self.parameters.get("record")
        return tuple(names) if isinstance(names, list) else ()

    @property
    def local_parameters(self) -> Mapping[str, Any]:
        """The parameters as kinds read them: with the paths of its files on this machine.

        Raises :class:`daemon.model.attachments.SutMissing` for a file that is not here.
        """
        if not self.files:
            return self.parameters
        paths = {name: stored_file(digest) for name, digest in self.files.items()}
        for name, path in paths.items():
            if not path.is_file():
                raise SutMissing(f'the file "{name}" of the system under test is not here: {path}')
        return {**self.parameters, FILES_PARAMETER: {name: str(p) for name, p in paths.items()}}


@dataclass(frozen=True, slots=True)
class MapSettings:
    """How the map given to the system under test is drawn.

    ``doors``: ``none`` leaves objects out (what a surveyor would keep), ``initial`` draws them
    in their initial state. ``rule`` says which cells a solid takes (:mod:`templates.occupancy`).
    ``file`` is the digest of a map that is given as it is, packed
    (:mod:`grammars.model.map_files`), and empty for one that is drawn.
    """

    resolution: float = 0.05
    doors: Literal["none", "initial"] = "none"
    # What was recorded before there was a choice was drawn so; campaigns choose outline.
    rule: MapRule = "touch"
    file: Annotated[str, Field(pattern=r"^([0-9a-f]{64})?$")] = ""


@dataclass(frozen=True, slots=True)
class OracleText:
    """An oracle by name, as written."""

    name: str
    text: str


@dataclass(frozen=True, slots=True)
class RunSpec:
    """One run: a cell of the campaign (scenario x SUT), one repeat of it.

    ``scene`` is the digest of the compiled scene; ``limit`` is simulated time [s]; ``seed`` the
    root of the run's seed tree. Behaviours are concrete: whatever was random in the campaign has
    been drawn, so a specification says exactly what the doors do.
    """

    campaign: str
    scenario: str
    sut: SutReference
    repeat: int
    scene: str
    robot: Robot
    mission: Mission
    behaviours: Script
    oracles: tuple[OracleText, ...]
    map: MapSettings
    seed: int
    limit: float
    engine: str = ENGINE_VERSION

    @property
    def cell(self) -> RunSpec:
        """The run without what tells it from others of its scenario and system."""
        return replace(self, repeat=0, behaviours=(), seed=0)

    @property
    def digest(self) -> str:
        """Identity of the run: 64 hexadecimal digits."""
        # Not cached: with slots it would need a field of its own, which would be serialised.
        cell, script = codec.to_json(self.cell), codec.to_json(self.behaviours, Script)
        return run_digest(text_digest(cell), text_digest(script), self.repeat, self.seed)

    @property
    def files(self) -> tuple[str, ...]:
        """Digests of the files it needs: those of its system under test, and its map."""
        return (*self.sut.files.values(), *([self.map.file] if self.map.file else []))

    @property
    def label(self) -> str:
        """A short name for people: ``S1/pilot/3``."""
        return f"{self.scenario}/{self.sut.name}/{self.repeat}"


def text_digest(text: bytes) -> str:
    """Return the digest of a cell or a script that is written as JSON."""
    return hashlib.sha256(text).hexdigest()


def run_digest(cell: str, script: str, repeat: int, seed: int | str) -> str:
    """Return the digest of a run by those of its cell and its script."""
    return text_digest(f"{cell} {script} {repeat} {seed}".encode())


@dataclass(frozen=True, slots=True)
class Snapshot:
    """How far a run is, for live views only: never recorded, never judged.

    ``pose`` is the true pose, ``estimate`` what the SUT believes; ``joints`` are positions in the
    order of :attr:`grammars.model.scene.Scene.joint_names`. The rest is there only while somebody
    watches: ``spread`` is xx, xy and yy of the estimate's covariance [m²]; laser ``returns``, the
    global ``plan`` and ``contacts`` since the snapshot before are points of the map frame, thinned
    and rounded: x, y, x, y, ... [cm]. So are the middles of cells of the ``costmap`` that block the
    robot. ``stack`` is a line of what a stack reports of itself. ``waiting`` says what an external
    system that is being brought up still lacks, empty once the run goes on. ``margin`` in ``unit``
    is that of ``oracle``, which of those that are not waiting for something is the first that has
    failed, else the one with the least margin so far.
    """

    time: Moment
    limit: Moment
    pose: Pose2
    estimate: Pose2 | None
    reached: WaypointCount
    waypoints: WaypointCount
    joints: tuple[float, ...]
    spread: tuple[SignalValue, SignalValue, SignalValue] | None = None
    returns: tuple[Centimetres, ...] = ()
    plan: tuple[Centimetres, ...] = ()
    contacts: tuple[Centimetres, ...] = ()
    costmap: tuple[Centimetres, ...] = ()
    stack: str = ""
    waiting: str = ""
    margin: float | None = None
    unit: str = ""
    oracle: str = ""


LARGEST_TRACE: Final = 4 * 2**30


@dataclass(frozen=True, slots=True)
class TraceInfo:
    """A written trace file: its SHA-256, size in bytes and number of messages."""

    sha256: str
    size: Annotated[int, Field(ge=0, le=LARGEST_TRACE)]
    messages: Annotated[int, Field(ge=0, le=LARGEST_TRACE)]


UnixTime: TypeAlias = Annotated[float, Field(ge=0.0, le=253_402_300_799.0)]
"""Seconds since 1970, UTC, up to the last year that has four digits."""


@dataclass(frozen=True, slots=True)
class Timing:
    """What a run cost [s]: wall clock, CPU, and the simulated time it covered.

    ``started`` is when, by the clock of the machine [s since 1970, UTC]; 0 where nobody kept it.
    """

    wall: Seconds
    cpu: Seconds
    simulated: Seconds
    started: UnixTime = 0.0


@dataclass(frozen=True, slots=True)
class LeadingMargin:
    """How near a run was to failing by an oracle: negative exactly when its verdict is a failure.

    In ``unit``, as the verdict's margin, but it leads to the failure also where that is flat
    (``never(contact)`` by the clearance). ``None`` when the run says nothing about it. ``object``
    is what it is about, ``waypoint`` the one that the robot was on its way to at that moment.
    """

    oracle: str
    margin: SignalValue | None
    unit: str
    object: str = ""
    waypoint: str = ""


@dataclass(frozen=True, slots=True)
class RunResult:
    """What a run leaves: verdicts, the trace's identity, why it ended, what it cost.

    ``ended``: ``finished`` (the SUT says the mission is over), ``limit`` (simulated time is up)
    or ``crashed`` (the SUT raised; ``note`` says what). ``leads`` are there where somebody asked
    for them: a search. ``machine`` is the processor that executed it, for people; nothing of the
    result follows from it. ``stopped`` is a run that the wall clock ended: it differs every time,
    and so is compared with no other.
    """

    spec: str
    outcome: Outcome
    verdicts: tuple[Verdict, ...]
    ended: RunEnding
    trace: TraceInfo
    timing: Timing
    note: str = ""
    leads: tuple[LeadingMargin, ...] = ()
    machine: str = ""
    stopped: bool = False

    @property
    def digest(self) -> str:
        """Digest of what must be equal when the same specification runs again (not timing)."""
        # ``ended`` and ``note`` are in the trace, ``leads`` follow from it. The order is part of
        # the digest.
        names = ("spec", "outcome", "verdicts", "trace")
        return codec.digest({name: getattr(self, name) for name in names})


LARGEST_RESULT: Final = 256 * 2**10
"""Bytes of a result in JSON: a hundred times what it has of three oracles. Its trace has the rest.
"""
_LONGEST_NOTE: Final = 2000


def bound_result(result: RunResult) -> RunResult:
    """Return a result of at most :data:`LARGEST_RESULT` bytes: as it is, or without the rest.

    Long notes and evidence go first, and only then verdicts, all of them: a part of them would
    look like the whole; leading margins, which are short, last of all. The outcome stays; ``note``
    says what was left out.
    """
    size = len(codec.to_json(result))
    if size <= LARGEST_RESULT:
        return result
    words = f"its result had {size} bytes, {LARGEST_RESULT} are kept of one: "
    note = result.note[:_LONGEST_NOTE]
    shorter = replace(
        result,
        verdicts=tuple(map(shorten_evidence, result.verdicts)),
        note=join_notes(f"{words}notes were cut", note),
        leads=tuple(replace(lead, object=lead.object[:LONGEST_EVIDENCE]) for lead in result.leads),
    )
    if len(codec.to_json(shorter)) <= LARGEST_RESULT:
        return shorter
    lost = f"{words}{len(result.verdicts)} verdicts were left out, judge its trace again"
    bare = replace(shorter, verdicts=(), note=join_notes(lost, note))
    return bare if len(codec.to_json(bare)) <= LARGEST_RESULT else replace(bare, leads=())


_PACKAGE: Final = "scenario-tui"
_DECIDE_TRACES: Final = (_PACKAGE, "numpy", "numba", "pymunk", "mcap", "rosbags")


def version_text(number: str, engine: str) -> str:
    """A version for comparison and for people: package and engine."""
    return f"{_PACKAGE} {number}, engine {engine}"


def own_version() -> str:
    """The version of this process."""
    return version_text(version(_PACKAGE), ENGINE_VERSION)


def install_hint(wanted: str) -> str:
    """What to do where ``wanted``, an :func:`own_version`, is not what is installed."""
    number = wanted.removeprefix(f"{_PACKAGE} ").partition(",")[0]
    return f"pip install '{_PACKAGE}=={number}' there"


def package_versions() -> dict[str, str]:
    """Versions of everything that can change a trace, for its metadata."""
    return {name: _installed_version(name) for name in _DECIDE_TRACES}


# Looked up once per process: it reads the metadata of an installed package from disk, and the
# parent of forked runs does so for all of them.
@functools.cache
def _installed_version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
