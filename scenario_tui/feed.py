"""What the dashboard knows: asked for by a thread of its own, taken by the screen's timer.

The thread leaves an immutable :class:`Picture` behind; telemetry and notices wait in queues that
forget the oldest. A second thread judges campaigns, which takes long when they are large. Nothing
here ever blocks the thread that draws.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal, TypeAlias, TypeVar

from daemon.errors import DaemonError, Refused, Unreachable
from daemon.protocol import (
    CampaignRow,
    Event,
    Live,
    Overview,
    RunDetail,
    RunPage,
    RunState,
    WorkerRow,
)
from grammars.scene import Scene
from grammars.values import Point2, Pose2
from scenario_tui.asking import Daemon, Opener, Subscription
from scenario_tui.judging import Judge
from scenario_tui.summary import Conclusion, Results

T = TypeVar("T")

REFRESH: Final = 1.0
"""Seconds between two looks when nothing is known to have changed."""
_BREATH: Final = 0.2
"""Seconds between two looks at least, however much happens."""
_GATHER: Final = 0.01
_RETRY: Final = 0.5
_PATIENCE: Final = 1.0
_JUDGING: Final = 0.1
"""Seconds between two looks for campaigns that should be judged."""
_SCENES_KEPT: Final = 8
_TRAIL_POINTS: Final = 4000

Action: TypeAlias = Callable[[Daemon], str]


@dataclass(frozen=True, slots=True)
class RunsWanted:
    """A page of runs, as :meth:`scenario_tui.asking.Daemon.runs` takes it."""

    campaign: str = ""
    state: str = ""
    outcome: str = ""
    text: str = ""
    sort: str = "index"
    descending: bool = False
    offset: int = 0
    limit: int = 100
    scenario: str = ""
    sut: str = ""


@dataclass(frozen=True, slots=True)
class Want:
    """What the screen in front shows beyond the overview: nothing else is asked for."""

    runs: RunsWanted | None = None
    run: str = ""
    workers: bool = False
    results: str = ""


@dataclass(frozen=True, slots=True)
class Recording:
    """Where the robot of a finished run went, and how everything stood at its end; ``path`` is
    the trace.
    """

    run: str
    path: Path
    pose: Pose2
    joints: tuple[float, ...]
    reached: int
    trail: tuple[Point2, ...]


@dataclass(frozen=True, slots=True)
class Unseen:
    """A run that is over but has nothing to look at, and why, for people."""

    run: str
    why: str


@dataclass(frozen=True, slots=True)
class Picture:
    """The last that is known; ``at`` is when it was true [s since the epoch], 0 for never.

    ``problem`` says why we are not connected; somebody is there but ``refused`` when that is what
    they said, as daemons of other versions do.
    """

    connected: bool = False
    problem: str = ""
    refused: bool = False
    at: float = 0.0
    overview: Overview | None = None
    campaigns: tuple[CampaignRow, ...] = ()
    workers: tuple[WorkerRow, ...] = ()
    wanted: RunsWanted | None = None
    page: RunPage | None = None
    detail: RunDetail | None = None
    scene: Scene | None = None
    recording: Recording | Unseen | None = None
    conclusions: Mapping[str, Conclusion] = field(default_factory=dict)
    results: Results | None = None


@dataclass(frozen=True, slots=True)
class Notice:
    """The outcome of an action, for people."""

    text: str
    severity: Literal["information", "error"] = "information"


class Feed:
    """Asks the daemon for what is wanted, again and again, over its restarts."""

    def __init__(
        self,
        open_daemon: Opener,
        *,
        clock: Callable[[], float] = time.time,
        judge: Judge | None = None,
    ) -> None:
        self._open = open_daemon
        self._judge = judge or Judge()
        self._judged = threading.Lock()
        self._clock = clock
        self._want = Want()
        self._picture = Picture()
        self._changed = False
        self._scenes: dict[str, Scene] = {}
        self._recording: tuple[tuple[str, str], Recording | Unseen] | None = None
        self._watching: Subscription | None = None
        self._watched = self._detailed = ""
        self._actions: deque[Action] = deque()
        self._lives: deque[Live] = deque(maxlen=512)
        self._notices: deque[Notice] = deque(maxlen=16)
        self._wake = threading.Event()
        self._asked = threading.Event()
        self._closing = False
        self.on_answer: Callable[[], object] = _nobody_waits
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="feed", daemon=True)

    def connect(self) -> AbstractContextManager[Daemon]:
        """Return a connection of one's own, for questions that may take a while."""
        return self._open()

    def start(self) -> None:
        """Begin to ask."""
        self._thread.start()

    def close(self) -> None:
        """Stop asking; returns when the thread has left."""
        self._closing = True
        self._hurry()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)

    def look(self, want: Want) -> None:
        """Say what is to be shown now."""
        if want != self._want:
            self._want = want
            self._hurry()

    def refresh(self) -> None:
        """Ask again at once."""
        self._hurry()

    def do(self, action: Action) -> None:
        """Have something done; what it returns, or why it was refused, becomes a notice."""
        self._actions.append(action)
        self._hurry()

    def _hurry(self) -> None:
        self._asked.set()
        self._wake.set()

    def take(self) -> tuple[Picture | None, list[Live], list[Notice]]:
        """Return what is new: the picture when it changed, telemetry, notices.

        A bug in the asking thread is raised here, where it is seen.
        """
        if self._failure is not None:
            raise self._failure
        changed, self._changed = self._changed, False
        return self._picture if changed else None, _drain(self._lives), _drain(self._notices)

    def _run(self) -> None:
        while not self._closing:
            try:
                self._session()
            except DaemonError as error:
                self._lose(error)
                self._forget()
                self._wake.wait(_RETRY)
                self._wake.clear()
            except Exception as error:
                self._failure = error
                return

    def _lose(self, error: DaemonError) -> None:
        """Keep what is known, and why nothing more is."""
        refused = not isinstance(error, Unreachable)
        self._show(replace(self._picture, connected=False, problem=str(error), refused=refused))

    def _session(self) -> None:
        """Ask over one connection until it breaks or the feed is closed."""
        with self._open() as daemon:
            subscription = daemon.events(self._on_event, self._on_live)
            leaving = threading.Event()
            judging = threading.Thread(
                target=self._judging, args=(daemon, leaving), name="judge", daemon=True
            )
            judging.start()
            try:
                while not self._closing:
                    self._wake.clear()
                    self._asked.clear()
                    self.step(daemon)
                    self._breathe(daemon)
                    self._wake.wait(REFRESH - _BREATH)
            finally:
                leaving.set()
                # A question about a large campaign may still wait for a daemon that is gone.
                judging.join(_PATIENCE)
                self._unwatch()
                subscription.close()

    def _breathe(self, daemon: Daemon) -> None:
        """Let some time pass between two looks; only what people wait for is answered at once."""
        until = time.monotonic() + _BREATH
        while self._asked.wait(max(0.0, until - time.monotonic())) and not self._closing:
            # Keys often come several at once: the last of them says what is wanted.
            time.sleep(_GATHER)
            self._asked.clear()
            self.answer(daemon)

    def _judging(self, daemon: Daemon, leaving: threading.Event) -> None:
        """Judge what changed until the connection is left."""
        while not leaving.wait(_JUDGING):
            try:
                if self.judge(daemon):
                    self._wake.set()
            except DaemonError:
                continue  # whoever takes the pictures notices too, and says so
            except Exception as error:
                if not leaving.is_set():  # else the connection was closed while it was used
                    self._failure = error
                return

    def judge(self, daemon: Daemon) -> bool:
        """Judge one campaign if one changed; return whether there was one."""
        with self._judged:
            return self._judge.step(daemon, self._picture.campaigns, self._want.results)

    def _on_event(self, event: Event) -> None:
        if event.campaign:
            self._judge.touch(event.campaign)
        self._wake.set()

    def answer(self, daemon: Daemon) -> bool:
        """Do what was asked for and find out what is newly wanted; return whether a page was."""
        while self._actions:
            self._act(daemon, self._actions.popleft())
        want, picture = self._want, self._picture
        turned = want.runs is not None and want.runs != picture.wanted
        if want.runs is not None and turned:
            picture = replace(picture, wanted=want.runs, page=_page(daemon, want.runs))
        if want.run and (picture.detail is None or picture.detail.row.id != want.run):
            picture = self._with_run(daemon, picture, want.run)
        if picture is not self._picture:
            self._show(picture)
            self.on_answer()
        return turned

    def step(self, daemon: Daemon) -> None:
        """Do what was asked for, then take one picture."""
        turned = self.answer(daemon)
        want = self._want
        picture = replace(
            self._picture,
            connected=True,
            problem="",
            refused=False,
            overview=daemon.overview(),
            campaigns=daemon.campaigns(),
            conclusions=self._judge.conclusions,
            results=self._judge.results,
            at=self._clock(),
        )
        if want.workers:
            picture = replace(picture, workers=daemon.workers())
        if want.runs is not None and not (turned and want.runs == picture.wanted):
            picture = replace(picture, wanted=want.runs, page=_page(daemon, want.runs))
        if want.run:
            picture = self._with_run(daemon, picture, want.run)
        self._watch(daemon, picture.detail if want.run else None)
        self._show(picture)

    def _with_run(self, daemon: Daemon, picture: Picture, run: str) -> Picture:
        detail = self._detail(daemon, run)
        scene = self._scene(daemon, detail.spec.scene) if detail is not None else None
        recording = self._recorded(daemon, detail)
        return replace(picture, detail=detail, scene=scene, recording=recording)

    def _forget(self) -> None:
        """Forget what was asked for: nobody expects it to be done when the daemon is back."""
        if _drain(self._actions):
            self._notices.append(Notice("no daemon answers: nothing was done", "error"))

    def _watch(self, daemon: Daemon, detail: RunDetail | None) -> None:
        """Have details of the run that is shown sent while it runs, and of no other."""
        running = detail is not None and detail.row.state is RunState.RUNNING
        run = detail.row.id if detail is not None and running else ""
        if run == self._watched:
            return
        self._unwatch()
        if run:
            self._watching, self._watched = daemon.watch(run, self._on_detail), run

    def _unwatch(self) -> None:
        if self._watching is not None:
            self._watching.close()
        self._watching, self._watched, self._detailed = None, "", ""

    def _on_live(self, live: Live) -> None:
        # What is told to everybody comes late for a run that is watched.
        if live.run != self._detailed:
            self._lives.append(live)

    def _on_detail(self, live: Live) -> None:
        self._detailed = live.run
        self._lives.append(live)

    def _act(self, daemon: Daemon, action: Action) -> None:
        try:
            said = action(daemon)
        except DaemonError as error:
            self._notices.append(Notice(str(error), "error"))
        else:
            if said:
                self._notices.append(Notice(said))

    def _detail(self, daemon: Daemon, run: str) -> RunDetail | None:
        try:
            return daemon.run(run)
        except Refused as error:
            self._notices.append(Notice(str(error), "error"))
            return None

    def _recorded(self, daemon: Daemon, detail: RunDetail | None) -> Recording | Unseen | None:
        """Return what the trace of a run says that is over, or why it says nothing."""
        if detail is None or detail.row.state in (RunState.QUEUED, RunState.RUNNING):
            return None
        key = (detail.row.id, detail.row.trace)
        if self._recording is None or self._recording[0] != key:
            if can_be_brought(detail, daemon):
                size = 0.0 if detail.result is None else detail.result.trace.size / 1e6
                seen = Unseen(detail.row.id, f"Bringing its trace here, {size:.1f} MB …")
                self._recording = (key, seen)
                threading.Thread(target=self._bring, args=(key, detail), daemon=True).start()
            else:
                self._recording = (key, read_recording(detail))
        return self._recording[1]

    def _bring(self, key: tuple[str, str], detail: RunDetail) -> None:
        """Bring a trace here beside everything else that is asked."""
        seen: Recording | Unseen
        try:
            with self._open() as daemon:
                seen = read_recording(detail, daemon)
        except DaemonError as error:
            seen = Unseen(detail.row.id, f"Its trace cannot be brought here: {error}")
        if self._recording is not None and self._recording[0] == key:
            self._recording = (key, seen)
            self._wake.set()

    def _scene(self, daemon: Daemon, digest: str) -> Scene | None:
        if digest not in self._scenes:
            try:
                scene = daemon.scene(digest)
            except Refused:
                return None  # without the scene there is no map; everything else is shown
            while len(self._scenes) >= _SCENES_KEPT:
                self._scenes.pop(next(iter(self._scenes)))
            self._scenes[digest] = scene
        return self._scenes[digest]

    def _show(self, picture: Picture) -> None:
        self._picture = picture
        self._changed = True


def traced(detail: RunDetail, source: Daemon | None = None) -> Path | Unseen:
    """Return where the trace of a run lies on this machine, or why there is none.

    One that lies elsewhere is brought here if ``source`` is given; that may take a while.
    """
    run, path = detail.row.id, Path(detail.row.trace)
    if detail.row.state in (RunState.QUEUED, RunState.RUNNING):
        return Unseen(run, f"This run is {detail.row.state}: its trace is there when it is over.")
    if detail.result is None:
        what = f"This run was {detail.row.state}: there is nothing to look at."
        return Unseen(run, f"{what}\n\nr queues it again.")
    if not detail.row.trace:
        return Unseen(run, "No trace of this run was kept.")
    if path.is_file():
        return path
    if source is not None:
        return _brought(detail, source)
    what = "Look at it where its worker is, or run it again."
    return Unseen(run, f"Its trace is not on this machine (any more): {path}\n\n{what}")


def _brought(detail: RunDetail, source: Daemon) -> Path | Unseen:
    from daemon.store import local_copy, recorded

    try:
        return local_copy(recorded(detail), source)
    except DaemonError as error:
        return Unseen(detail.row.id, f"Its trace cannot be brought here: {error}")


def can_be_brought(detail: RunDetail, source: Daemon) -> bool:
    """Whether the trace of a run lies elsewhere, and can be had from there as far as is known."""
    from daemon.store import is_url

    row = detail.row
    if detail.result is None or not row.trace or Path(row.trace).is_file():
        return False
    if is_url(row.trace):
        return True
    try:
        source.piece(row.id, 0)
    except Refused:
        return False
    return True


def read_recording(detail: RunDetail, source: Daemon | None = None) -> Recording | Unseen:
    """Return the recorded way of a run that is over, or why its trace cannot be read here.

    One that lies elsewhere is brought here if ``source`` is given.
    """
    from daemon.trace import TraceError, read_trace

    run, path = detail.row.id, traced(detail, source)
    if isinstance(path, Unseen):
        return path
    try:
        trace = read_trace(path)
    except TraceError as error:
        said = "; ".join(d.message for d in error.diagnostics)
        what = "Run it again, or copy the file anew from where its worker is."
        return Unseen(run, f"Its trace cannot be used: {said}: {path}\n\n{what}")
    way, joints = trace.ground_truth, trace.joints
    if not len(way.time):
        return Unseen(run, f"Its trace says nothing of where the robot was: {path}")
    every = max(1, len(way.time) // _TRAIL_POINTS)
    trail = tuple(zip(way.x[::every].tolist(), way.y[::every].tolist(), strict=True))
    return Recording(
        run=run,
        path=path,
        pose=Pose2(float(way.x[-1]), float(way.y[-1]), float(way.yaw[-1])),
        joints=tuple(joints.position[-1].tolist()) if len(joints.time) else (),
        reached=trace.progress[-1].reached if trace.progress else 0,
        trail=trail,
    )


def _page(daemon: Daemon, wanted: RunsWanted) -> RunPage:
    return daemon.runs(
        wanted.campaign,
        state=wanted.state,
        outcome=wanted.outcome,
        text=wanted.text,
        sort=wanted.sort,
        descending=wanted.descending,
        offset=wanted.offset,
        limit=wanted.limit,
        scenario=wanted.scenario,
        sut=wanted.sut,
    )


def _nobody_waits() -> None:
    """What is new is taken when somebody looks."""


def _drain(waiting: deque[T]) -> list[T]:
    drained = []
    while waiting:
        drained.append(waiting.popleft())
    return drained
