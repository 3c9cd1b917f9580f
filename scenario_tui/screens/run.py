"""One run: what the oracles say, and the robot from above while it runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from textual import work
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical, VerticalScroll
from textual.widgets import Static

from daemon.protocol import CampaignRow, RunDetail, RunState
from daemon.verdict import Verdict
from grammars.scene import Scene
from scenario_tui.feed import Picture, Recording, Unseen, Want
from scenario_tui.screens.base import empty
from scenario_tui.screens.steering import Steering
from scenario_tui.tracks import Track
from scenario_tui.widgets.run_text import run_text
from scenario_tui.widgets.top_view import LEGEND, TopView, View
from scenario_tui.wording import run_label

if TYPE_CHECKING:
    from scenario_tui.app import Dashboard


class RunPanel(Vertical):
    """Words and map of one run, one above the other."""

    def compose(self) -> ComposeResult:
        """Lay out words and map."""
        with VerticalScroll(id="words"):
            yield Static(id="run-text")
        with Vertical(id="above"):
            yield Static(id="unseen")
            yield TopView(id="map")
            yield Static(LEGEND, id="legend")

    def show(self, dashboard: Dashboard, picture: Picture | None) -> None:
        """Show the run of a picture, or nothing."""
        detail = picture.detail if picture is not None else None
        if picture is None or detail is None:
            self.query_one("#run-text", Static).update("")
            self._above(None)
            return
        track = dashboard.tracks.get(detail.row.id)
        if detail.row.state is not RunState.RUNNING:
            track = None
        self.query_one("#run-text", Static).update(run_text(detail, track))
        seen = picture.recording
        seen = seen if seen is not None and seen.run == detail.row.id else None
        if isinstance(seen, Unseen):
            self._above(None, seen.why)
        elif picture.scene is not None:
            self._above(view_of(detail, picture.scene, track, seen))
        else:
            self._above(None)

    def _above(self, view: View | None, why: str = "") -> None:
        """Show the map, or why there is none."""
        top, legend = self.query_one(TopView), self.query_one("#legend")
        top.show(view)
        empty(self.query_one("#unseen"), top, why)
        legend.display = not why


class RunScreen(Steering):
    """A run by its id."""

    AUTO_FOCUS = "#words"

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("v", "view", "Map/words", tooltip="Switch between map and words"),
        Binding("p", "play", "Play", tooltip="Watch the recorded run from above"),
        Binding("z", "zoom", "Zoom", tooltip="Nearer to the robot, then back to everything"),
        Binding("c", "cancel", "Cancel", tooltip="Cancel the campaign, after a question"),
        Binding("r", "retry", "Retry", tooltip="Queue lost and cancelled runs again, or look anew"),
    ]

    def __init__(self, run: str) -> None:
        super().__init__()
        self._run = run
        self._chosen = False

    def body(self) -> ComposeResult:
        """The panel alone."""
        yield RunPanel(id="panel")

    def want(self) -> Want:
        """This run."""
        return Want(run=self._run)

    def campaign(self) -> CampaignRow | None:
        """Return the campaign the run is part of."""
        wanted = self._run.rpartition(".")[0]
        return next((row for row in self.dashboard.picture.campaigns if row.id == wanted), None)

    def trail(self) -> str:
        """Where we are."""
        detail = self._detail()
        label = run_label(detail.row) if detail is not None else self._run
        return f"campaigns › {self._run.rpartition('.')[0]} › {label}"

    def _detail(self) -> RunDetail | None:
        detail = self.dashboard.picture.detail
        return detail if detail is not None and detail.row.id == self._run else None

    def show(self, picture: Picture) -> None:
        """Show the run; a running one starts with its map, a finished one with its verdicts."""
        detail = self._detail()
        if detail is None:
            return
        if not self._chosen:
            self.set_class(detail.row.state is RunState.RUNNING, "-map")
            self._chosen = True
        self.query_one(RunPanel).show(self.dashboard, picture)

    def action_view(self) -> None:
        """Switch between map and words where there is room for one only."""
        self.toggle_class("-map")

    def action_play(self) -> None:
        """Play the recorded run, once its trace is read."""
        detail, seen = self._detail(), self.dashboard.picture.recording
        if detail is None:
            return
        if isinstance(seen, Recording) and seen.run == self._run and detail.result is not None:
            self._open(seen.path, detail.result.verdicts)
            return
        why = "a run can be played when it is over"
        if isinstance(seen, Unseen) and seen.run == self._run:
            why = seen.why
        self.notify(why)

    @work(thread=True, exclusive=True)
    def _open(self, path: Path, verdicts: tuple[Verdict, ...]) -> None:
        """Read the whole trace outside the thread that draws, then show it."""
        # What reads traces takes a while to load, and the dashboard is to be there at once.
        from daemon.trace import TraceError
        from scenario_tui.playback import open_playback
        from scenario_tui.screens.replay import ReplayScreen

        try:
            playback = open_playback(path, verdicts)
        except TraceError as error:
            self.app.call_from_thread(self.notify, str(error), severity="error")
            return
        self.app.call_from_thread(self.app.push_screen, ReplayScreen(playback))

    def action_zoom(self) -> None:
        """Come nearer to the robot on the map."""
        self.query_one(TopView).zoom()


def view_of(
    detail: RunDetail, scene: Scene, track: Track | None, recording: Recording | None
) -> View:
    """Return the top view of a run: live, as recorded, or as it will start."""
    resting = tuple(value for obj in scene.objects for value in obj.initial)
    spec = detail.spec
    if track is not None:
        seen = track.snapshot
        joints = seen.joints if len(seen.joints) == len(resting) else resting
        trail = tuple(track.trail)
        return View(
            scene, spec.robot, spec.mission, joints, seen.pose, seen.estimate, seen.reached, trail
        )
    if recording is not None:
        joints = recording.joints if len(recording.joints) == len(resting) else resting
        return View(
            scene,
            spec.robot,
            spec.mission,
            joints,
            recording.pose,
            reached=recording.reached,
            trail=recording.trail,
        )
    return View(scene, spec.robot, spec.mission, resting)
