"""Lines between a worker and the daemon that can be pulled, that are slow, or that lose packets.

With root and ``ip`` a worker gets a network namespace of its own, tied to ours by a veth pair that
can be taken down. Elsewhere a relay on loopback stops passing bytes on: connections stay open and
silent, as with a pulled cable.
"""

import itertools
import os
import queue
import shutil
import socket
import subprocess
import threading
import time
from contextlib import ExitStack, contextmanager, suppress

import pytest

from daemon.batch.paths import INSECURE_VARIABLE

_NUMBERS = itertools.count()
CHUNKS = (2**12, 2**16)
"""Bytes passed on at a time, at least and at most: a tenth of a second where that is between."""
BUFFER = 2**18
"""Bytes that may wait in each direction; what is under way on a long and fast line comes on top."""
UNLIMITED = 1e9
"""Bytes per second of a line that only delays: more than goes through this program."""


class Relay:
    """Passes bytes between a free loopback port and the daemon's, until it is cut.

    Each byte comes ``delay`` [s] later, and at most ``rate`` bytes a second in each direction.
    """

    through = ()

    def __init__(self, endpoint, delay=0.0, rate=UNLIMITED):
        self._delay, self._rate = delay, rate
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
        chunk = min(max(CHUNKS[0], int(self._rate / 10.0)), CHUNKS[1])
        under_way = queue.Queue(int(BUFFER + self._rate * self._delay) // chunk)
        threading.Thread(target=self._give, args=(under_way, source, sink), daemon=True).start()
        free, data = time.monotonic(), b"-"
        while data:
            data = b""
            with suppress(OSError):
                data = source.recv(chunk)
            self._whole.wait()
            if self._until_cut is not None:
                self._until_cut -= len(data)
                if self._until_cut < 0:
                    self._until_cut = None
                    self._whole.clear()
                    self._whole.wait()
            free = max(free, time.monotonic()) + len(data) / self._rate
            under_way.put((free + self._delay, data))

    def _give(self, under_way, source, sink):
        data = b"-"
        with suppress(OSError):
            while data:
                due, data = under_way.get()
                time.sleep(max(0.0, due - time.monotonic()))
                self._whole.wait()
                sink.sendall(data)
        for one in (source, sink):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)


@contextmanager
def relay(endpoint, **shape):
    """A cable that is a relay, for the block."""
    made = Relay(endpoint, **shape)
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
