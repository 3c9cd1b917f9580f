"""Lines between a worker and the daemon that can be pulled, that are slow, or that lose packets.

With root and ``ip`` a worker gets a network namespace of its own, tied to ours by a veth pair that
can be taken down. Elsewhere a relay on loopback stops passing bytes on: connections stay open and
silent, as with a pulled cable.

A slow line is a process of its own, so that nothing else in the test delays it:
``python -m tests.chaos.links PORT HOST:PORT DELAY RATE`` listens at loopback and passes on what
comes, each byte DELAY seconds later and at most RATE bytes a second in each direction.
"""

import asyncio
import itertools
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
from contextlib import ExitStack, contextmanager, suppress
from types import SimpleNamespace

import pytest

from daemon.batch.paths import INSECURE_VARIABLE
from tests.parts import ROOT, eventually, free_endpoint

_CHUNK = 65536
_NUMBERS = itertools.count()
CHUNKS = (2**12, 2**16)
"""Bytes passed on at a time, at least and at most: a tenth of a second where that is between."""
BUFFER = 2**18
"""Bytes that may wait in each direction; what is under way on a long and fast line comes on top."""
UNLIMITED = 1e9
"""Bytes per second of a line that only delays: more than goes through this program."""


class Relay:
    """Passes bytes between a free loopback port and the daemon's, until it is cut."""

    through = ()

    def __init__(self, endpoint):
        host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
        self._target = host, int(port)
        self._whole = threading.Event()
        self._whole.set()
        self._until_cut = None
        self._sockets = []
        self._door = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._door.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self):
        self._whole.clear()

    def cut_after(self, size):
        """Cut it as soon as so many bytes more have passed, one way and the other."""
        self._until_cut = size

    @property
    def is_cut(self):
        return not self._whole.is_set()

    def mend(self):
        self._whole.set()

    def sever(self):
        """Cut it so that both ends notice at once: new connections wait until it is mended."""
        self._whole.clear()
        for one in self._sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)

    def close(self):
        """End all connections."""
        self.mend()
        for one in (self._door, *self._sockets):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()

    def _accept(self):
        with suppress(OSError):
            while True:
                here, _ = self._door.accept()
                threading.Thread(target=self._connect, args=(here,), daemon=True).start()

    def _connect(self, here):
        self._whole.wait()
        try:
            there = socket.create_connection(self._target)
        except OSError:
            here.close()  # no daemon just now: as good as refused
            return
        self._sockets += [here, there]
        for source, sink in ((here, there), (there, here)):
            threading.Thread(target=self._pump, args=(source, sink), daemon=True).start()

    def _pump(self, source, sink):
        with suppress(OSError):
            while data := source.recv(_CHUNK):
                self._whole.wait()
                if self._until_cut is not None:
                    self._until_cut -= len(data)
                    if self._until_cut < 0:
                        self._until_cut = None
                        self._whole.clear()
                        self._whole.wait()
                sink.sendall(data)
        for one in (source, sink):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)


@contextmanager
def relay(endpoint):
    """A cable that is a relay, for the block."""
    made = Relay(endpoint)
    try:
        yield made
    finally:
        made.close()


def _ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True)


class Namespace:
    """A network namespace with one veth pair to ours."""

    def __init__(self, name, device, endpoint):
        self.device, self.endpoint = device, endpoint
        self.through = ("ip", "netns", "exec", name)

    def cut(self):
        _ip("link", "set", self.device, "down")

    def mend(self):
        _ip("link", "set", self.device, "up")

    def drop_packets(self, share):
        """Lose that ``share`` of the packets in each direction; whether this kernel can."""
        for chain in ("INPUT", "OUTPUT"):
            rule = ("iptables", "-A", chain, "-m", "statistic", "--mode", "random")
            words = (*self.through, *rule, "--probability", str(share), "-j", "DROP")
            if subprocess.run(words, check=False, capture_output=True).returncode:
                return False
        return True


def may_make_namespaces():
    """Whether this machine lets us: root, ``ip``, and a kernel that agrees."""
    if os.geteuid() != 0 or shutil.which("ip") is None:
        return False
    name = f"try{os.getpid()}"
    made = subprocess.run(["ip", "netns", "add", name], capture_output=True, check=False)
    subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)
    return made.returncode == 0


@contextmanager
def namespaces(count, port):
    """An endpoint in a subnet of its own, and ``count`` namespaces that reach it by a cable each.

    The address lies in 198.18.0.0/15, which is set aside for tests of networks (RFC 2544).
    """
    us = (8 * os.getpid() + next(_NUMBERS)) % 16_000
    address = f"198.18.{us // 250}.{us % 250 + 1}"
    endpoint = f"tcp/{address}:{port}"
    with ExitStack() as stack, pytest.MonkeyPatch.context() as patch:
        # Nobody but this machine's namespaces reaches that address.
        patch.setenv(INSECURE_VARIABLE, "1")
        _ip("addr", "add", f"{address}/32", "dev", "lo")
        stack.callback(_ip, "addr", "del", f"{address}/32", "dev", "lo")
        made = [stack.enter_context(_namespace(us, i, address, endpoint)) for i in range(count)]
        yield endpoint, made


@contextmanager
def _namespace(us, index, address, endpoint):
    name, device, inside = f"chaos{us}-{index}", f"ch{us}o{index}", f"ch{us}i{index}"
    ours, theirs = (f"198.19.{us % 250}.{4 * index + k}" for k in (1, 2))
    _ip("netns", "add", name)
    try:
        _ip("link", "add", device, "type", "veth", "peer", "name", inside, "netns", name)
        _ip("addr", "add", f"{ours}/30", "dev", device)
        _ip("link", "set", device, "up")
        within = ("-n", name)
        _ip(*within, "addr", "add", f"{theirs}/30", "dev", inside)
        for one in ("lo", inside):
            _ip(*within, "link", "set", one, "up")
        _ip(*within, "route", "add", address, "via", ours)
        yield Namespace(name, device, endpoint)
    finally:
        _ip("netns", "del", name)  # and with it the pair


@contextmanager
def links(endpoint, count, *, isolated):
    """The endpoint to listen at, and ``count`` cables to it, the best this machine has."""
    if isolated:
        with namespaces(count, int(endpoint.rpartition(":")[2])) as made:
            yield made
        return
    with ExitStack() as stack:
        yield endpoint, [stack.enter_context(relay(endpoint)) for _ in range(count)]


@contextmanager
def slow_line(endpoint, *, delay=0.0, rate=UNLIMITED):
    """A line with ``delay`` [s] and ``rate`` [bytes/s] each way; cut, it freezes."""
    mine = free_endpoint()
    command = [sys.executable, "-m", "tests.chaos.links", mine.rpartition(":")[2]]
    command += [endpoint.removeprefix("tcp/"), str(delay), str(rate)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE)
    try:
        eventually(process.stdout.readline)
        yield SimpleNamespace(
            endpoint=mine,
            through=(),
            cut=lambda: process.send_signal(signal.SIGSTOP),
            mend=lambda: process.send_signal(signal.SIGCONT),
        )
    finally:
        process.kill()
        process.communicate()


async def _pass_on(reader, writer, delay, rate):
    """Pass bytes on one way until one of both ends is closed."""
    clock = asyncio.get_running_loop()
    chunk = min(max(CHUNKS[0], int(rate / 10.0)), CHUNKS[1])
    under_way = asyncio.Queue(int(BUFFER + rate * delay) // chunk)

    async def take():
        free, data = clock.time(), b"-"
        while data:
            data = b""
            with suppress(ConnectionError):
                data = await reader.read(chunk)
            free = max(free, clock.time()) + len(data) / rate
            await under_way.put((free + delay, data))

    async def give():
        data = b"-"
        while data:
            due, data = await under_way.get()
            await asyncio.sleep(max(0.0, due - clock.time()))
            if not writer.is_closing():  # what still comes in then is for nobody
                with suppress(ConnectionError):
                    writer.write(data)
                    await writer.drain()
        writer.close()

    await asyncio.gather(take(), give())


async def _serve(port, target, delay, rate):
    async def connect(here, back):
        try:
            there, forth = await asyncio.open_connection(*target)
        except OSError:
            back.close()  # no daemon just now: as good as refused
            return
        ways = ((here, forth), (there, back))
        await asyncio.gather(*(_pass_on(*way, delay, rate) for way in ways))

    server = await asyncio.start_server(connect, "127.0.0.1", port)
    print("passes on", flush=True)
    async with server:
        await server.serve_forever()


if __name__ == "__main__":
    port, target, delay, rate = sys.argv[1:]
    host, _, number = target.rpartition(":")
    asyncio.run(_serve(int(port), (host, int(number)), float(delay), float(rate)))
