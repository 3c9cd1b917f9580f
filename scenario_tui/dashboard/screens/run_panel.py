"""One run in words and from above: the panel beside the table of runs, and the map alone."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import replace
from typing import TYPE_CHECKING

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Vertical, VerticalScroll
from textual.widgets import Static

from daemon.model.live_view import from_centimetres
from daemon.model.run_state import RunState
from daemon.model.spec import RunSpec
from daemon.model.status import RunDetail
from grammars.model.scene import Scene
from scenario_tui.dashboard.live_tracks import Track
from scenario_tui.dashboard.recorded_traces import TraceSummary, UnavailableTrace
from scenario_tui.dashboard.run_watch import RunNews
from scenario_tui.dashboard.screens.base import show_message_or
from scenario_tui.dashboard.widgets.map_frame import View
from scenario_tui.dashboard.widgets.map_legend import MapLegend
from scenario_tui.dashboard.widgets.static_text import StaticText
from scenario_tui.dashboard.widgets.top_view import TopView
from scenario_tui.text.run_text import run_text

if TYPE_CHECKING:
    from scenario_tui.dashboard.base_app import BaseDashboard


class RunMap(Vertical):
    """The top view of a run with its legend, or why there is none."""

    def __init__(self) -> None:
        super().__init__(id="above")

    def compose(self) -> ComposeResult:
        """Lay out map, legend, and what is said instead of them."""
        yield StaticText(id="unseen")
        yield StaticText(id="note")
        yield TopView(id="map")
        yield MapLegend()

    def show(self, view: View | None) -> None:
        """Show another view, or nothing."""
        self.query_one(TopView).show(view)

    def explain(self, why: str) -> None:
        """Say ``why`` there is no map; show the map when that is empty."""
        show_message_or(self.query_one("#unseen"), self.query_one(TopView), why)
        self.query_one("#legend").display = not why

    def note(self, words: str) -> None:
        """Say something above the map, or nothing."""
        note = self.query_one("#note", Static)
        note.update(Text(words))
        note.display = bool(words)


class RunPanel(Vertical):
    """Words and map of one run, one above the other: beside the table of runs."""

    def compose(self) -> ComposeResult:
        """Lay out words and map."""
        with VerticalScroll(id="words"):
            yield StaticText(id="run-text")
        yield RunMap()

    def show(self, dashboard: BaseDashboard, news: RunNews | None) -> None:
        """Show a run as the dashboard knows it, or nothing."""
        words, above = self.query_one("#run-text", Static), self.query_one(RunMap)
        if news is None:
            words.update("")
            above.show(None)
            above.explain("")
            return
        track = track_of(dashboard, news.detail)
        words.update(run_text(news.detail, track.snapshot if track else None))
        view, why = top_view_of(news, track)
        above.show(view)
        above.explain(why)


def track_of(dashboard: BaseDashboard, detail: RunDetail) -> Track | None:
    """Return what was heard of a run that is running."""
    running = detail.row.state is RunState.RUNNING
    return dashboard.tracks.get(detail.row.id) if running else None


def top_view_of(news: RunNews, track: Track | None) -> tuple[View | None, str]:
    """Return the top view of a run as far as it is known, and why there is none."""
    if isinstance(news.recording, UnavailableTrace):
        return None, news.recording.why
    if news.scene is None:
        return None, ""
    return _view(news.detail, news.scene, track, news.recording), ""


def _view(
    detail: RunDetail, scene: Scene, track: Track | None, recording: TraceSummary | None
) -> View:
    """Return the top view of a run: live, as recorded, or as it will start."""
    resting = tuple(scene.initial_joints.values())
    spec = detail.spec
    if track is not None:
        return tracked_view(scene, spec, track)
    if recording is not None:
        return View(
            scene,
            spec.robot,
            spec.mission,
            recording.joints if len(recording.joints) == len(resting) else resting,
            recording.pose,
            reached=recording.reached,
            trail=recording.trail,
        )
    return View(scene, spec.robot, spec.mission, resting)


def heard_view(view: View, track: Track, time: float) -> View | None:
    """Return the top view of a running run as it was at ``time`` [s]: where the robot was, and how
    the doors stood.

    ``None`` before anything was heard of it. Nobody keeps what its laser saw.
    """
    index = bisect_right(track.heard_of, time, key=lambda one: one.time) - 1
    if index < 0:
        return None
    then = track.heard_of[index]
    count = bisect_right(track.times, time)
    return replace(
        view,
        joints=then.joints if len(then.joints) == len(view.joints) else view.joints,
        robot_pose=then.pose,
        estimate=then.estimate,
        reached=then.reached,
        trail=view.trail[:count],
        clearances=view.clearances[:count],
        returns=(),
        plan=(),
        contacts=(),
        spread=None,
        costmaps={},
    )


def tracked_view(scene: Scene, spec: RunSpec, track: Track) -> View:
    """Return the top view of what goes on at this moment."""
    seen, resting = track.snapshot, tuple(scene.initial_joints.values())
    return View(
        scene,
        spec.robot,
        spec.mission,
        # The scene may be of another attempt than what was heard, if only for a moment.
        seen.joints if len(seen.joints) == len(resting) else resting,
        seen.pose,
        seen.estimate,
        seen.reached,
        tuple(track.trail),
        from_centimetres(seen.returns),
        from_centimetres(seen.plan),
        tuple(track.flashes),
        seen.spread,
        costmaps={"stack's": from_centimetres(seen.costmap)} if seen.costmap else {},
    )
