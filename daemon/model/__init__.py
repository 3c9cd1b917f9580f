"""The values of the daemon: specifications, results, verdicts, SUT protocol, messages, verbs.

A shelf of public modules; it imports no other room of the daemon.
"""
