"""Causes of a failure: the layers and parameters it needs, and the smallest run that still fails.

:func:`load_case` takes a run of a campaign file apart. :func:`explain_failure` searches by delta
debugging and executes every candidate by :func:`daemon.run.execute`. :func:`save_campaign` writes
the smallest failing run as a campaign.
"""

from daemon.analysis.blame._case import Candidate, RunCase, case_of, load_case
from daemon.analysis.blame._elements import Blame, Explanation, NoFailureError, story_lines
from daemon.analysis.blame._runner import BudgetSpentError, CandidateRunner, candidate_verdicts
from daemon.analysis.blame._save import save_campaign
from daemon.analysis.blame._search import ddmin, explain_failure

__all__ = [
    "Blame",
    "BudgetSpentError",
    "Candidate",
    "CandidateRunner",
    "Explanation",
    "NoFailureError",
    "RunCase",
    "candidate_verdicts",
    "case_of",
    "ddmin",
    "explain_failure",
    "load_case",
    "save_campaign",
    "story_lines",
]
