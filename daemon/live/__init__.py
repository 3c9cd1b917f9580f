"""Worlds that go on by the wall clock: for people and for stacks that are being developed.

Nothing here is recorded or judged, and nothing is promised to repeat.
"""
