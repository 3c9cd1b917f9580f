"""Scenario-based testing of mobile robots: campaigns, their runs, their results.

    import scenario_tui as st

    results = st.run("campaign.yaml")
    assert results.passed, results.unexpected
    print(results["busy-house", "pilot"]["keeps-clear"].margin)

The public interface is ``__all__``, :mod:`scenario_tui.errors` and :mod:`scenario_tui.sut`.
Everything else may change.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from scenario_tui._own_packages import claim_names

# From now on the names of the project's other packages mean ours.
claim_names()

if TYPE_CHECKING:
    from daemon.batch.errors import DaemonError
    from daemon.model.verdicts import Outcome, Verdict
    from grammars.text.diagnostics import Finding, InputError, ScenarioError
    from scenario_tui.library.campaign import Campaign, Scene, load, run, submit
    from scenario_tui.library.checking import check
    from scenario_tui.library.job import Job
    from scenario_tui.library.results import Cell, Results, Run, results
    from scenario_tui.library.signal import Signal
    from scenario_tui.library.trace import Trace
else:
    _HOMES = {
        "daemon.batch.errors": ("DaemonError",),
        "daemon.model.verdicts": ("Outcome", "Verdict"),
        "grammars.text.diagnostics": ("Finding", "InputError", "ScenarioError"),
        "scenario_tui.library.campaign": ("Campaign", "Scene", "load", "run", "submit"),
        "scenario_tui.library.checking": ("check",),
        "scenario_tui.library.job": ("Job",),
        "scenario_tui.library.results": ("Cell", "Results", "Run", "results"),
        "scenario_tui.library.signal": ("Signal",),
        "scenario_tui.library.trace": ("Trace",),
    }

    def __getattr__(name):
        # The command line imports this package at every TAB, and needs none of it.
        for module, names in _HOMES.items():
            if name in names:
                return getattr(import_module(module), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__():
        return __all__


__all__ = [
    "Campaign",
    "Cell",
    "DaemonError",
    "Finding",
    "InputError",
    "Job",
    "Outcome",
    "Results",
    "Run",
    "ScenarioError",
    "Scene",
    "Signal",
    "Trace",
    "Verdict",
    "check",
    "load",
    "results",
    "run",
    "submit",
]
