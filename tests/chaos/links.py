"""Cables between a worker and the daemon that can be pulled.

With root and ``ip`` a worker gets a network namespace of its own, tied to ours by a veth pair that
can be taken down. Elsewhere a relay on loopback stops passing bytes on: connections stay open and
silent, as with a pulled cable.
"""

from __future__ import annotations

import itertools
import os
import shutil
import socket
import subprocess
import threading
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Protocol

import pytest

from daemon.batch.paths import INSECURE_VARIABLE

_CHUNK = 65536
_NUMBERS = itertools.count()


class Link(Protocol):
    """A way to the daemon: ``endpoint`` to connect to, ``through`` to start the worker with."""

    @property
    def endpoint(self): ...

    @property
    def through(self): ...

    def cut(self):
        """Pull the cable."""

    def mend(self):
        """Plug it in again."""


class Relay:
    """Passes bytes between a free loopback port and the daemon's, until it is cut."""

    def __init__(self, endpoint):
        host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
        self._target = (host, int(port))
        self._whole = threading.Event()
        self._whole.set()
        self._until_cut = None
        self._sockets = []
        self._door = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._door.getsockname()[1]}"
        self.through = ()
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


@dataclass(slots=True)
class Namespace:
    """A network namespace with one veth pair to ours."""

    name: str
    device: str
    endpoint: str

    @property
    def through(self):
        return ("ip", "netns", "exec", self.name)

    def cut(self):
        _ip("link", "set", self.device, "down")

    def mend(self):
        _ip("link", "set", self.device, "up")


@contextmanager
def relay(endpoint):
    """A cable that is a relay, for the block."""
    made = Relay(endpoint)
    try:
        yield made
    finally:
        made.close()


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
    subnet = f"198.19.{us % 250}.{4 * index}"
    ours, theirs = (subnet.rpartition(".")[0] + f".{4 * index + k}" for k in (1, 2))
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


def _ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True)


@contextmanager
def links(endpoint, count, *, isolated):
    """The endpoint to listen at, and ``count`` cables to it, the best this machine has."""
    if isolated:
        port = int(endpoint.rpartition(":")[2])
        with namespaces(count, port) as (outside, made):
            yield outside, list(made)
        return
    with ExitStack() as stack:
        cables = itertools.repeat(endpoint, count)
        yield endpoint, [stack.enter_context(relay(end)) for end in cables]
