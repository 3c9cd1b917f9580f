"""Actions on a campaign, each declared once: its command, its key, its request, its outcome.

The command line and the dashboard share them, with the same words.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from daemon.batch.amounts import size_text
from grammars.text.words import command_line, count_noun

if TYPE_CHECKING:
    from daemon.model.status import DeletedCampaign


@dataclass(frozen=True, slots=True)
class CampaignAction:
    """``command`` is typed behind ``scenario``; in the dashboard it is the id of the ``key``.

    ``options`` are typed behind it. ``request`` asks a daemon, by the id of a campaign, for the
    action. It returns the number of runs; a deletion returns the deleted campaigns. ``outcome`` is
    the sentence afterwards, with ``campaign``, ``runs`` and the keywords of the request.
    """

    command: str
    request: Callable[..., Any]
    outcome: str
    key: str = ""
    name: str = ""
    tooltip: str = ""
    options: tuple[str, ...] = ()

    def outcome_text(
        self, campaign: str, runs: int, command: Callable[..., str] = command_line, **more: Any
    ) -> str:
        """Return the sentence about ``runs`` runs of a campaign.

        ``command`` quotes a command about its daemon.
        """
        resume = command(RESUME.command, campaign, *RESUME.options)
        words = {"campaign": campaign, "runs": count_noun(runs, "run"), "resume": resume}
        return self.outcome.format_map(words | more)


PAUSE: Final = CampaignAction(
    "pause",
    lambda daemon, campaign: daemon.steer(campaign, paused=True),
    "paused {campaign} with {runs} queued; continue with `{resume}`",
    "P",
    "Pause",
    "Start no more runs of the campaign",
)
RESUME: Final = CampaignAction(
    "pause",
    lambda daemon, campaign: daemon.steer(campaign, paused=False),
    "resumed {campaign}, {runs} queued",
    "P",
    "Resume",
    "Continue the paused campaign",
    options=("--off",),
)
"""Has the key of :data:`PAUSE`, which is in effect for a campaign that is not paused."""
CANCEL: Final = CampaignAction(
    "cancel",
    lambda daemon, campaign: daemon.cancel(campaign),
    "cancelled {runs} of {campaign}",
    "c",
    "Cancel",
    "Cancel unfinished runs, after a question",
)
RETRY: Final = CampaignAction(
    "retry",
    lambda daemon, campaign, only: daemon.retry(campaign, only=only),
    "queued {runs} of {campaign} again",
    "r",
    "Retry",
    "Queue lost, failed or all runs again",
)
ACKNOWLEDGE: Final = CampaignAction(
    "acknowledge",
    lambda daemon, campaign: daemon.acknowledge(campaign),
    "acknowledged {campaign}: {runs} did not pass; new failures are shown again",
    "A",
    "Acknowledge",
    "Mark the failures as seen: the first line is quiet about them until there are new ones",
)
PRIORITY: Final = CampaignAction(
    "priority",
    lambda daemon, campaign, priority: daemon.steer(campaign, priority=priority),
    "{campaign} has priority {priority}",
    "number_sign",
    "Priority",
    "A campaign with a higher priority runs first",
)
DELETE: Final = CampaignAction(
    "delete",
    lambda daemon, *campaigns: daemon.delete(campaigns),
    "deleted {campaign}: {runs}, {traces}",
    "D",
    "Delete",
    "Delete a finished campaign with results and traces, after a question",
)


def deletion_text(deleted: Sequence[DeletedCampaign], *, dry: bool = False) -> str:
    """Return a line for each deleted campaign with its runs and traces; ``dry`` if it stays."""
    lines = [
        DELETE.outcome_text(
            one.campaign,
            one.runs,
            traces=f"{count_noun(one.traces, 'trace')}, {size_text(one.bytes)}",
        )
        for one in deleted
    ]
    return "\n".join(f"would have {line}" if dry else line for line in lines)
