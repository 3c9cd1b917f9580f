"""Causes of a failure: what flips the verdict, and the smallest run that still fails.

:func:`find_run` finds a run by what people call it, :func:`load_case` takes it apart,
:func:`explain_failure` searches (bisection and delta debugging, every candidate executed by
:func:`daemon.run.execute`), :func:`save_campaign` writes the smallest failing run as a campaign.
"""

from daemon.analysis.blame._case import (
    CampaignRun,
    Candidate,
    RunCase,
    case_of,
    find_run,
    load_case,
)
from daemon.analysis.blame._elements import Blame, Element, NoFailureError, Without, sut_differences
from daemon.analysis.blame._runner import (
    SLOTS,
    BudgetSpentError,
    CandidateExecutor,
    CandidateResult,
    CandidateRunner,
    execute_candidates,
    judge_verdict,
    unresolved_candidate,
)
from daemon.analysis.blame._save import save_campaign
from daemon.analysis.blame._search import (
    LINEAR_STEPS,
    BlameResult,
    ddmin,
    explain_failure,
    find_flip,
    split_evenly,
)
from daemon.analysis.blame._story import story_lines

__all__ = [
    "LINEAR_STEPS",
    "SLOTS",
    "Blame",
    "BlameResult",
    "BudgetSpentError",
    "CampaignRun",
    "Candidate",
    "CandidateExecutor",
    "CandidateResult",
    "CandidateRunner",
    "Element",
    "NoFailureError",
    "RunCase",
    "Without",
    "case_of",
    "ddmin",
    "execute_candidates",
    "explain_failure",
    "find_flip",
    "find_run",
    "judge_verdict",
    "load_case",
    "save_campaign",
    "split_evenly",
    "story_lines",
    "sut_differences",
    "unresolved_candidate",
]
