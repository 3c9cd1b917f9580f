"""A run, before and after: the specification that identifies it, and its result.

``RunSpec`` holds everything that decides the bytes of a trace: same digest, same trace, as long as
all machines that execute runs have the same versions.

Runs of the same system and robot call the same compiled kernels, whatever the numbers in their
parameters; these are listed under one name (:func:`kernel_list`). A :func:`short_run` before the
first run makes a missing list and missing machine code.
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
from daemon.model.ids import Centimetres, Moment, Seconds, SignalValue, WaypointCount
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
"""Version of the engine; raise it with every change to traces of the same specification."""


@dataclass(frozen=True, slots=True)
class SutReference:
    """A configured system under test: its name in the campaign, its kind and its parameters.

    ``files`` are the digests of the files it needs, by name (:mod:`daemon.model.attachments`). The
    parameter ``repeatable: false`` marks a system outside of the simulator: the same specification
    gives the same world and noise, but not the same answers.
    """

    name: str
    kind: str
    parameters: dict[str, Any]
    files: dict[str, Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]] = field(default_factory=dict)

    @property
    def repeatable(self) -> bool:
        """True if every repetition of its runs gives the same bytes."""
        return self.parameters.get("repeatable") is not False

    @property
    def recorded(self) -> tuple[str, ...]:
        """Reports that its runs record (:data:`~daemon.model.stack_reports.REPORT_TOPICS`)."""
        names = self.parameters.get("record")
        return tuple(names) if isinstance(names, list) else ()

    @property
    def local_parameters(self) -> Mapping[str, Any]:
        """The parameters with the paths of its files on this machine.

        Raises :class:`daemon.model.attachments.SutMissing` for a missing file.
        """
        if not self.files:
            return self.parameters
        paths = {name: stored_file(digest) for name, digest in self.files.items()}
        for name, path in paths.items():
            if not path.is_file():
                raise SutMissing(f'the file "{name}" of the system under test is missing: {path}')
        return {**self.parameters, FILES_PARAMETER: {name: str(p) for name, p in paths.items()}}


@dataclass(frozen=True, slots=True)
class MapSettings:
    """Settings of the map for the system under test.

    ``doors``: ``none`` omits objects, as a surveyor would; ``initial`` draws them in their initial
    state. ``rule`` decides which cells a solid takes (:mod:`templates.occupancy`). ``file`` is the
    digest of a ready map, packed (:mod:`grammars.model.map_files`), and empty for a drawn one.
    """

    resolution: float = 0.05
    doors: Literal["none", "initial"] = "none"
    # Older traces, from before there was a choice, have this rule; campaigns choose outline.
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
    root of the run's seed tree. Behaviours are concrete: random choices of the campaign are drawn
    already, so a specification fixes the motion of the doors.
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
        """The run without repeat, behaviours and seed: equal for all of its scenario and system."""
        return replace(self, repeat=0, behaviours=(), seed=0)

    @property
    def digest(self) -> str:
        """Identity of the run: 64 hexadecimal digits."""
        # Not cached: with slots the cache would be a field, which would be serialised.
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
    """Return the digest of a cell or a script in JSON."""
    return hashlib.sha256(text).hexdigest()


def run_digest(cell: str, script: str, repeat: int, seed: int | str) -> str:
    """Return the digest of a run from those of its cell and its script."""
    return text_digest(f"{cell} {script} {repeat} {seed}".encode())


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Progress of a run, for live views only: never recorded, never judged.

    ``pose`` is the true pose, ``estimate`` the SUT's; ``joints`` are positions in the order of
    :attr:`grammars.model.scene.Scene.joint_names`. The rest is present only while somebody
    watches. ``spread`` is xx, xy and yy of the estimate's covariance [m²]. Laser ``returns``, the
    global ``plan``, ``contacts`` since the last snapshot, and the centres of blocking cells of the
    ``costmap`` are points of the map frame, thinned and rounded: x, y, x, y, ... [cm]. ``stack`` is
    a line with the stack's own reports. ``waiting`` describes what an external system still lacks
    while it starts. ``margin`` in ``unit`` is that of ``oracle``: the first oracle that has failed,
    otherwise the one with the least margin so far, without those that wait for something.
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
"""Seconds since 1970, UTC, up to the last year with four digits."""


@dataclass(frozen=True, slots=True)
class Timing:
    """Cost of a run [s]: wall clock, CPU, and its simulated time.

    ``started`` is its start by the clock of the machine [s since 1970, UTC]; 0 if unknown.
    """

    wall: Seconds
    cpu: Seconds
    simulated: Seconds
    started: UnixTime = 0.0


@dataclass(frozen=True, slots=True)
class LeadingMargin:
    """Nearness of a run to a failure of an oracle: negative exactly when the verdict is a failure.

    In ``unit``, as the verdict's margin, but it leads to the failure even where that margin is flat
    (``never(contact)`` by the clearance). ``None`` if the run has no such margin. ``object`` is the
    object involved, ``waypoint`` the robot's next one at that moment.
    """

    oracle: str
    margin: SignalValue | None
    unit: str
    object: str = ""
    waypoint: str = ""


@dataclass(frozen=True, slots=True)
class RunResult:
    """Result of a run: verdicts, the trace's identity, reason of the end, cost.

    ``ended``: ``finished`` (the SUT reports the end of the mission), ``limit`` (simulated time is
    up) or ``crashed`` (the SUT raised; ``note`` has the error). ``leads`` are present on request of
    a search. ``machine`` is the processor that executed the run, for information only. ``stopped``
    marks a run that the wall clock ended: it differs every time, so it is never compared.
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
        """Digest of everything that must be equal when the same specification runs again."""
        # ``ended`` and ``note`` are in the trace, ``leads`` follow from it. The order is part of
        # the digest.
        names = ("spec", "outcome", "verdicts", "trace")
        return codec.digest({name: getattr(self, name) for name in names})


LARGEST_RESULT: Final = 256 * 2**10
"""Largest result in JSON [B], a hundred times one of three oracles; the trace has the rest."""
_LONGEST_NOTE: Final = 2000


def bound_result(result: RunResult) -> RunResult:
    """Return a result of at most :data:`LARGEST_RESULT` bytes, shortened if necessary.

    Long notes and evidence are cut first. Then all verdicts go, since a part of them would look
    complete; leading margins, which are short, go last. The outcome stays; ``note`` names the
    omissions.
    """
    size = len(codec.to_json(result))
    if size <= LARGEST_RESULT:
        return result
    words = f"its result had {size} bytes, more than the limit of {LARGEST_RESULT}: "
    note = result.note[:_LONGEST_NOTE]
    shorter = replace(
        result,
        verdicts=tuple(map(shorten_evidence, result.verdicts)),
        note=join_notes(f"{words}notes were cut", note),
        leads=tuple(replace(lead, object=lead.object[:LONGEST_EVIDENCE]) for lead in result.leads),
    )
    if len(codec.to_json(shorter)) <= LARGEST_RESULT:
        return shorter
    omission = f"{words}{len(result.verdicts)} verdicts were left out, judge its trace again"
    bare = replace(shorter, verdicts=(), note=join_notes(omission, note))
    return bare if len(codec.to_json(bare)) <= LARGEST_RESULT else replace(bare, leads=())


_PACKAGE: Final = "scenario-tui"
_DECIDE_TRACES: Final = (_PACKAGE, "numpy", "numba", "pymunk", "mcap", "rosbags")


def version_text(number: str, engine: str) -> str:
    """Return a version for comparison and for people: package and engine."""
    return f"{_PACKAGE} {number}, engine {engine}"


def own_version() -> str:
    """Return the version of this process."""
    return version_text(version(_PACKAGE), ENGINE_VERSION)


def install_hint(release: str) -> str:
    """Return the command that installs ``release``, an :func:`own_version`, on another machine."""
    number = release.removeprefix(f"{_PACKAGE} ").partition(",")[0]
    return f"pip install '{_PACKAGE}=={number}' there"


def package_versions() -> dict[str, str]:
    """Return the versions of everything that can change a trace, for its metadata."""
    return {name: _installed_version(name) for name in _DECIDE_TRACES}


# Cached: it reads the metadata of an installed package from disk, once for all forked runs.
@functools.cache
def _installed_version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


WITH_KERNELS: Final = ("pilot", "ros")
"""Kinds of systems with kernels of their own; the short run omits all others."""
SHORT: Final = 20.0
"""Length of the short run [s, simulated]: each system plans and avoids an obstacle in it."""
_IDLE: Final = SutReference("idle", "idle", {})


def short_run(spec: RunSpec) -> RunSpec:
    """Return the beginning of a run, without a system that is a plug-in or an outside process."""
    sut = spec.sut if spec.sut.kind in WITH_KERNELS else _IDLE
    return replace(spec, sut=sut, limit=min(SHORT, spec.limit))


def kernel_list(spec: RunSpec) -> str:
    """Return the name of the list of kernels that runs like ``spec`` call."""
    sut = short_run(spec).sut
    robot = codec.to_plain(spec.robot, Robot)
    choices = repr((_choices(sut.parameters), _choices(robot)))
    return f"{sut.kind}-{hashlib.sha256(choices.encode()).hexdigest()[:12]}"


def _choices(value: Any) -> Any:
    """Return a tree of parameters without its numbers, which choose no kernel."""
    if isinstance(value, Mapping):
        return sorted((name, _choices(each)) for name, each in value.items())
    if isinstance(value, list | tuple):
        return [_choices(each) for each in value]
    return value if isinstance(value, bool | str) else None
