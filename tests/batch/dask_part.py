"""A Dask scheduler, or workers, of a test: on loopback, without nannies.

``python -m tests.batch.dask_part scheduler PORT KIND FOLDER`` or ``... worker ADDRESS KIND
FOLDER THREADS ...``, one process for each number of threads. Of kind ``other`` they have another
version of ours, of kind ``lacking`` none.
"""

import asyncio
import os
import sys
from importlib import import_module

import dask
from distributed import Scheduler, Worker


def disguise(kind):
    """Be an installation with another engine, or without this program."""
    if kind == "other":
        versions = import_module("daemon.model.spec")
        versions.ENGINE_VERSION = "0"
    elif kind == "lacking":
        sys.modules["daemon"] = None


async def serve(what, where, threads):
    common = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    if what == "scheduler":
        server = Scheduler(port=int(where), **common)
    else:
        server = Worker(where, nthreads=threads, **common)
    async with server:
        print("serving", server.address, flush=True)
        await server.finished()


def main(what, where, kind, folder, *threads):
    disguise(kind)
    # The first worker's death is one death: with more than one chance a test would take long.
    dask.config.set({"temporary-directory": folder, "distributed.scheduler.allowed-failures": 0})
    for number in threads[1:]:
        if os.fork() == 0:
            asyncio.run(serve(what, where, int(number)))
            return
    asyncio.run(serve(what, where, int(threads[0]) if threads else 0))


if __name__ == "__main__":
    main(*sys.argv[1:])
