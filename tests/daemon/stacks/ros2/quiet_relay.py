"""Stands in for the relay beside a stack that nobody speaks to: it stays, and says nothing."""

import signal

signal.signal(signal.SIGINT, signal.SIG_DFL)
signal.pause()
