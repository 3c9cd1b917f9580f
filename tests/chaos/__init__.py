"""Campaigns of violence: real daemons and workers are killed, frozen, cut off and starved."""
