"""The values of the daemon: specifications, results, verdicts, the SUT protocol, bus messages.

Public modules that import no other room of the daemon.
"""
