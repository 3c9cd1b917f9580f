"""Public face of the project: campaigns, their execution, their results, traces.

:mod:`scenario_tui` publishes what is public of it. The command line and the dashboard are its
first users.
"""
