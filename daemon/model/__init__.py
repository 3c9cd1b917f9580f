"""The values of the daemon: specifications, results, verdicts, SUT protocol, messages, verbs.

Public modules that import no other room of the daemon.
"""
