"""What can be done to a campaign, declared once: the command, its key, what is said afterwards.

The command line and the dashboard do the same things and say them in the same words.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from scenario_tui.text.formatting import pluralise


@dataclass(frozen=True, slots=True)
class CampaignAction:
    """``command`` is the word behind ``scenario``, and in the dashboard the id of its ``key``.

    ``outcome`` is what to say when it is done: ``campaign`` and ``runs`` are filled in, and what
    else it names.
    """

    command: str
    outcome: str
    key: str = ""
    name: str = ""
    tooltip: str = ""

    def outcome_text(self, campaign: str, runs: int = 0, **words: object) -> str:
        """Say what became of ``runs`` runs of a campaign."""
        return self.outcome.format(campaign=campaign, runs=pluralise(runs, "run"), **words)


PAUSE: Final = CampaignAction(
    "pause",
    "paused {campaign}; {runs} wait until {until}",
    "P",
    "Pause",
    "Start no more runs of the campaign, or go on",
)
RESUME: Final = CampaignAction("resume", "resumed {campaign}, {runs} queued")
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

ACTIONS: Final = {action.command: action for action in (PAUSE, RESUME, CANCEL, RETRY, PRIORITY)}
"""All of them by command."""
KEYED: Final = (PAUSE, CANCEL, RETRY, PRIORITY)
"""Those with a key, in the order the keys are listed."""
