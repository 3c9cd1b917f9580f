"""Why a run fails: which layer or parameter flips its verdict, and how little of it still fails.

:func:`find_run` says which run of which campaign file is meant, :func:`load_case` takes it apart,
:func:`blame` searches (bisection and delta debugging, every candidate executed by
:func:`daemon.run.execute`), :func:`save` writes the smallest failing run as a campaign.
"""

from daemon.blame._case import Candidate, Case, load_case
from daemon.blame._find import Meant, find_run
from daemon.blame._runner import SLOTS, BudgetSpentError, Runner
from daemon.blame._save import save
from daemon.blame._search import Found, blame
from daemon.blame._types import Blame, Element, NoFailureError, Without

__all__ = [
    "SLOTS",
    "Blame",
    "BudgetSpentError",
    "Candidate",
    "Case",
    "Element",
    "Found",
    "Meant",
    "NoFailureError",
    "Runner",
    "Without",
    "blame",
    "find_run",
    "load_case",
    "save",
]
