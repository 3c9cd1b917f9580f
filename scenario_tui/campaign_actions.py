"""What can be done to a campaign, declared once: the command, its key, what is said afterwards.

The command line and the dashboard do the same things and say them in the same words.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from daemon.batch.amounts import size_text
from grammars.text.words import count_noun

if TYPE_CHECKING:
    from daemon.model.status import DeletedCampaign


@dataclass(frozen=True, slots=True)
class CampaignAction:
    """``command`` is the word behind ``scenario``, and in the dashboard the id of its ``key``.

    Where that is another command with an option, ``typed`` are these words.

    ``outcome`` is what to say when it is done: ``campaign`` and ``runs`` are filled in, and what
    else it names.
    """

    command: str
    outcome: str
    key: str = ""
    name: str = ""
    tooltip: str = ""
    typed: tuple[str, ...] = ()

    @property
    def words(self) -> tuple[str, ...]:
        """What is typed behind ``scenario``: a command, and options."""
        return self.typed or (self.command,)

    def outcome_text(self, campaign: str, runs: int = 0, **words: object) -> str:
        """Say what became of ``runs`` runs of a campaign."""
        return self.outcome.format(campaign=campaign, runs=count_noun(runs, "run"), **words)


PAUSE: Final = CampaignAction(
    "pause",
    "paused {campaign}; {runs} wait until {until}",
    "P",
    "Pause",
    "Start no more runs of the campaign, or go on",
)
RESUME: Final = CampaignAction(
    "resume", "resumed {campaign}, {runs} queued", typed=("pause", "--off")
)
"""Has no key of its own: the one that pauses resumes a paused campaign."""
CANCEL: Final = CampaignAction(
    "cancel", "cancelled {runs} of {campaign}", "c", "Cancel", "What is not over, after a question"
)
RETRY: Final = CampaignAction(
    "retry",
    "queued {runs} of {campaign} again",
    "r",
    "Retry",
    "Queue lost, failed or all runs again",
)
PRIORITY: Final = CampaignAction(
    "priority",
    "{campaign} has priority {priority}",
    "number_sign",
    "Priority",
    "Which campaign goes first",
)
DELETE: Final = CampaignAction(
    "delete",
    "deleted {campaign}: {runs}, {traces}",
    "D",
    "Delete",
    "Remove a finished campaign with results and traces, after a question",
)

ACTIONS: Final = {
    action.command: action for action in (PAUSE, RESUME, CANCEL, RETRY, PRIORITY, DELETE)
}
"""All of them by command."""
KEYED: Final = (PAUSE, CANCEL, RETRY, PRIORITY, DELETE)
"""Those with a key, in the order the keys are listed."""


def deletion_text(gone: Sequence[DeletedCampaign], *, dry: bool = False) -> str:
    """Say what goes with campaigns, or would go, a line for each."""
    outcome = replace(DELETE, outcome=f"would have {DELETE.outcome}") if dry else DELETE
    return "\n".join(
        outcome.outcome_text(
            one.campaign,
            one.runs,
            traces=f"{count_noun(one.traces, 'trace')}, {size_text(one.bytes)}",
        )
        for one in gone
    )
