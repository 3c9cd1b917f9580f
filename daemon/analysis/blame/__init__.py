"""Why a run fails: which layer or parameter flips its verdict, and how little of it still fails.

:func:`find_run` says which run of which campaign file is meant, :func:`load_case` takes it apart,
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
from daemon.analysis.blame._layer_text import behaviour_sentences
from daemon.analysis.blame._runner import (
    BudgetSpentError,
    CandidateResult,
    CandidateRunner,
    execute_candidates,
)
from daemon.analysis.blame._save import save_campaign
from daemon.analysis.blame._search import (
    LINEAR_STEPS,
    ddmin,
    explain_failure,
    find_flip,
    split_evenly,
)

__all__ = [
    "LINEAR_STEPS",
    "Blame",
    "BudgetSpentError",
    "CampaignRun",
    "Candidate",
    "CandidateResult",
    "CandidateRunner",
    "Element",
    "NoFailureError",
    "RunCase",
    "Without",
    "behaviour_sentences",
    "case_of",
    "ddmin",
    "execute_candidates",
    "explain_failure",
    "find_flip",
    "find_run",
    "load_case",
    "save_campaign",
    "split_evenly",
    "sut_differences",
]
