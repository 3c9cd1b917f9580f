"""The screens of the dashboard: campaigns, runs of one, one run, workers."""
