"""Lines that are slow, far or lossy: a process that passes bytes on late, and dropped packets.

``python -m tests.chaos.lines PORT HOST:PORT --delay 0.1 --rate 40000`` listens at loopback and
passes on what comes, each byte ``delay`` seconds later and at most ``rate`` bytes a second in each
direction. A process of its own, so that nothing else in the test delays it.
"""

import argparse
import asyncio
import signal
import subprocess
import sys
from contextlib import contextmanager, suppress
from pathlib import Path

from tests.chaos.links import Relay
from tests.parts import eventually, free_endpoint

ROOT = Path(__file__).parents[2]
CHUNKS = (2**12, 2**16)
"""Bytes passed on at a time, at least and at most: a tenth of a second where that is between."""
BUFFER = 2**18
"""Bytes that may wait in each direction; what is under way on a long and fast line comes on top."""
UNLIMITED = 1e9
"""Bytes per second of a line that only delays: more than goes through this program."""


class _Direction:
    """Bytes that go one way."""

    def __init__(self, reader, writer, delay, rate):
        self._reader, self._writer = reader, writer
        self._delay, self._rate = delay, rate
        self._chunk = min(max(CHUNKS[0], int(rate / 10.0)), CHUNKS[1])
        room = int(BUFFER + rate * delay) // self._chunk
        self._under_way = asyncio.Queue(room)

    async def run(self):
        """Pass on until one of both ends is closed."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._take())
            group.create_task(self._give())

    async def _take(self):
        clock = asyncio.get_running_loop()
        free = clock.time()
        data = b"-"
        while data:
            data = b""
            with suppress(ConnectionError):
                data = await self._reader.read(self._chunk)
            free = max(free, clock.time()) + len(data) / self._rate
            await self._under_way.put((free + self._delay, data))

    async def _give(self):
        clock = asyncio.get_running_loop()
        data = b"-"
        while data:
            due, data = await self._under_way.get()
            await asyncio.sleep(max(0.0, due - clock.time()))
            if self._writer.is_closing():
                continue  # what still comes in is for nobody
            with suppress(ConnectionError):
                self._writer.write(data)
                await self._writer.drain()
        self._writer.close()


async def _serve(port, target, delay, rate):
    async def connect(here, back):
        try:
            there, forth = await asyncio.open_connection(*target)
        except OSError:
            back.close()  # no daemon just now: as good as refused
            return
        ways = (_Direction(here, forth, delay, rate), _Direction(there, back, delay, rate))
        await asyncio.gather(*(way.run() for way in ways))

    server = await asyncio.start_server(connect, "127.0.0.1", port)
    print("passes on", flush=True)
    async with server:
        await server.serve_forever()


class SlowLine:
    """A line to the daemon through a process that delays; cut, it is frozen."""

    def __init__(self, endpoint, process):
        self.endpoint = endpoint
        self.through = ()
        self._process = process

    def cut(self):
        self._process.send_signal(signal.SIGSTOP)

    def mend(self):
        self._process.send_signal(signal.SIGCONT)


@contextmanager
def slow_line(endpoint, *, delay=0.0, rate=UNLIMITED):
    """A line to ``endpoint`` with ``delay`` [s] each way and ``rate`` [bytes/s] each way."""
    mine = free_endpoint()
    command = [sys.executable, "-m", "tests.chaos.lines", mine.rpartition(":")[2]]
    command += [endpoint.removeprefix("tcp/"), "--delay", str(delay), "--rate", str(rate)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE)
    try:
        assert process.stdout is not None
        eventually(process.stdout.readline)
        yield SlowLine(mine, process)
    finally:
        process.kill()
        process.communicate()


class BreakingLine(Relay):
    """A relay that ends its connections when it is cut: both ends know at once."""

    def cut(self):
        self.sever()


@contextmanager
def breaking_line(endpoint):
    """A line that breaks when it is cut, for the block."""
    made = BreakingLine(endpoint)
    try:
        yield made
    finally:
        made.close()


def drop_packets(cable, share):
    """Lose that ``share`` of the packets in each direction, at random."""
    for chain in ("INPUT", "OUTPUT"):
        command = ("iptables", "-A", chain, "-m", "statistic", "--mode", "random")
        words = (*cable.through, *command, "--probability", str(share), "-j", "DROP")
        subprocess.run(words, check=True, capture_output=True)


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.chaos.lines", description=__doc__)
    parser.add_argument("port", type=int)
    parser.add_argument("target")
    parser.add_argument("--delay", type=float, default=0.0)
    parser.add_argument("--rate", type=float, default=UNLIMITED)
    asked = parser.parse_args()
    host, _, port = asked.target.rpartition(":")
    asyncio.run(_serve(asked.port, (host, int(port)), asked.delay, asked.rate))


if __name__ == "__main__":
    main()
