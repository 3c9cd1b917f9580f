"""The values of the daemon: specifications, results, verdicts, the SUT protocol, what travels on the bus.

A shelf of public modules; it imports no other room of the daemon.
"""
