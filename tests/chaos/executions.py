"""What executions say about themselves, beside anything that daemon and workers believe."""

import os
from collections import Counter


def note(log, what, spec):
    """Append a line to the file ``log``, if there is one; whole also when many write."""
    if not log:
        return
    line = f"{what} {spec.digest} {os.getpid()}\n".encode()
    file = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        os.write(file, line)
    finally:
        os.close(file)


class Executions:
    """The file in which executions note that they begin and end."""

    def __init__(self, path):
        self.path = path

    @property
    def begun(self):
        """How often each run was begun, by the digest of its specification."""
        return self._counted("begin")

    @property
    def ended(self):
        """How often each run was executed to its end."""
        return self._counted("end")

    @property
    def said(self):
        """How often each run has printed all that it prints."""
        return self._counted("said")

    @property
    def started_over(self):
        """Executions beyond the first one of each run."""
        begun = self.begun
        return begun.total() - len(begun)

    def _counted(self, what):
        if not self.path.exists():
            return Counter()
        words = (line.split() for line in self.path.read_text().splitlines())
        return Counter(digest for kind, digest, _ in words if kind == what)
