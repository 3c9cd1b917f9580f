"""Public library of the project: campaigns, their execution, their results, traces.

:mod:`scenario_tui` publishes its public names. The command line and the dashboard use it, too.
"""
