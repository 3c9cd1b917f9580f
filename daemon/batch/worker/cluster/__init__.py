"""A Dask cluster as one worker with many slots: the gateway leases, the cluster executes.

Between the gateway and the cluster go names, bytes and JSON of ours, never objects; that Dask
itself pickles is the cluster's own business, see ``docs/clusters.md``.
"""

from daemon.batch.worker.cluster._gateway import Gateway, RemoteExecution

__all__ = [
    "Gateway",
    "RemoteExecution",
]
