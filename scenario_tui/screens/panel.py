"""The panel of one run beside the table of runs, and what its map shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.app import ComposeResult
from textual.containers import Vertical, VerticalScroll
from textual.widgets import Static

from daemon.glance import metres
from daemon.protocol import RunDetail, RunState
from grammars.scene import Scene
from scenario_tui.picture import Picture
from scenario_tui.recordings import Recording, Unseen
from scenario_tui.screens.base import empty
from scenario_tui.tracks import Track
from scenario_tui.widgets.run_text import run_text
from scenario_tui.widgets.top_view import LEGEND, TopView, View

if TYPE_CHECKING:
    from scenario_tui.base_app import BaseDashboard


class RunPanel(Vertical):
    """Words and map of one run, one above the other: beside the table of runs."""

    def compose(self) -> ComposeResult:
        """Lay out words and map."""
        with VerticalScroll(id="words"):
            yield Static(id="run-text")
        with Vertical(id="above"):
            yield Static(id="unseen")
            yield TopView(id="map")
            yield Static(LEGEND, id="legend")

    def show(self, dashboard: BaseDashboard, picture: Picture | None) -> None:
        """Show the run of a picture, or nothing."""
        detail = picture.detail if picture is not None else None
        if picture is None or detail is None:
            self.query_one("#run-text", Static).update("")
            self._above(None)
            return
        track = track_of(dashboard, detail)
        snapshot = track.snapshot if track else None
        self.query_one("#run-text", Static).update(run_text(detail, snapshot))
        seen = recording_of(picture, detail.row.id)
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


def track_of(dashboard: BaseDashboard, detail: RunDetail) -> Track | None:
    """Return what was heard of a run that is running."""
    running = detail.row.state is RunState.RUNNING
    return dashboard.tracks.get(detail.row.id) if running else None


def recording_of(picture: Picture, run: str) -> Recording | Unseen | None:
    """Return what the picture knows of the trace of a run."""
    seen = picture.recording
    return seen if seen is not None and seen.run == run else None


def view_of(
    detail: RunDetail, scene: Scene, track: Track | None, recording: Recording | None
) -> View:
    """Return the top view of a run: live, as recorded, or as it will start."""
    resting = tuple(value for obj in scene.objects for value in obj.initial)
    spec = detail.spec
    if track is not None:
        seen = track.snapshot
        joints = seen.joints if len(seen.joints) == len(resting) else resting
        return View(
            scene, spec.robot, spec.mission, joints, seen.pose, seen.estimate, seen.reached,
            tuple(track.trail), metres(seen.returns), metres(seen.plan), tuple(track.flashes),
            seen.spread,
        )  # fmt: skip
    if recording is not None:
        joints = recording.joints if len(recording.joints) == len(resting) else resting
        return View(
            scene, spec.robot, spec.mission, joints, recording.pose, reached=recording.reached,
            trail=recording.trail,
        )  # fmt: skip
    return View(scene, spec.robot, spec.mission, resting)
