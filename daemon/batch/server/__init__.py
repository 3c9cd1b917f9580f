"""The daemon itself: the ledger behind a Zenoh router, and a local worker."""

from daemon.batch.server._opening import exposure_warning
from daemon.batch.server._runtime import DaemonSettings
from daemon.batch.server._serve import STOP_MARGIN, serve
