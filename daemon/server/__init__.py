"""The daemon itself: the ledger behind a Zenoh router, and a local worker."""

from daemon.server._listening import exposure
from daemon.server._serve import STOPPING, serve
from daemon.server._settings import Settings

__all__ = ["STOPPING", "Settings", "exposure", "serve"]
