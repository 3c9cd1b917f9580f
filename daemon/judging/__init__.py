"""Judging recorded runs: oracles on one trace, assessments of a campaign, their statistics."""
