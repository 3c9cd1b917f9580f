"""Worlds that run by the wall clock: for people and for stacks in development.

They are not recorded, judged or repeatable.
"""
