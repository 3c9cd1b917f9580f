"""Cancelling and retrying campaigns, always with a question first."""

from __future__ import annotations

from daemon.protocol import CampaignRow
from scenario_tui.asking import Daemon
from scenario_tui.screens.base import BaseScreen
from scenario_tui.screens.dialogs import Question
from scenario_tui.wording import counted


class Steering(BaseScreen):
    """A screen about a campaign that can be cancelled or retried from it."""

    def campaign(self) -> CampaignRow | None:
        """Return the campaign the keys are about."""
        raise NotImplementedError

    def action_matrix(self) -> None:
        """Show the campaign's matrix."""
        row = self.campaign()
        if row is not None:
            self.dashboard.open_matrix(row.id)

    def action_cancel(self) -> None:
        """Ask whether to cancel, then do it."""
        row = self.campaign()
        if row is None:
            return
        waiting = row.queued + row.running
        if not waiting:
            self.notify(f"{row.id} is finished, there is nothing to cancel")
            return

        def decided(yes: bool | None) -> None:
            if yes:
                self.dashboard.feed.do(lambda daemon: _cancel(daemon, row.id))

        text = f"Cancel {counted(waiting, 'unfinished run')} of {row.id}? Its results are kept."
        self.app.push_screen(Question(text, f"scenario cancel {row.id}"), decided)

    def action_retry(self) -> None:
        """Ask whether to queue lost and cancelled runs again; without any, look again."""
        row = self.campaign()
        self.dashboard.feed.refresh()
        if row is None or not row.lost + row.cancelled:
            self.notify("refreshed; nothing is lost or cancelled here")
            return

        def decided(yes: bool | None) -> None:
            if yes:
                self.dashboard.feed.do(lambda daemon: _retry(daemon, row.id))

        runs = counted(row.lost + row.cancelled, "lost or cancelled run")
        text = f"Queue {runs} of {row.id} again?"
        self.app.push_screen(Question(text, f"scenario retry {row.id}"), decided)


def _cancel(daemon: Daemon, campaign: str) -> str:
    return f"cancelled {counted(daemon.cancel(campaign), 'run')} of {campaign}"


def _retry(daemon: Daemon, campaign: str) -> str:
    return f"queued {counted(daemon.retry(campaign), 'run')} of {campaign} again"
