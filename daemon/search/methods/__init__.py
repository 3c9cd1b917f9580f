"""Methods of searching: which values to try next, made of what the ones before gave."""

from daemon.search.methods._make import (
    COVARIANCE_FROM,
    METHODS,
    make_method,
    method_misfit,
    method_problem,
    missing_library,
)
from daemon.search.methods._stages import MethodProposal, SearchMethod

__all__ = [
    "COVARIANCE_FROM",
    "METHODS",
    "MethodProposal",
    "SearchMethod",
    "make_method",
    "method_misfit",
    "method_problem",
    "missing_library",
]
