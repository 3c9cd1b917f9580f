"""Methods of searching: which values to try next, made of what the ones before gave."""

from daemon.search.methods._make import make_method
from daemon.search.methods._protocol import MethodProposal, SearchMethod

__all__ = ["MethodProposal", "SearchMethod", "make_method"]
