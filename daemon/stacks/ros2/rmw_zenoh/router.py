"""The Zenoh session of a run: the router that the nodes of a stack meet at, on loopback only."""

from __future__ import annotations

import json
import socket
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import zenoh

from daemon.stacks.ros2.link import LinkLost
from daemon.stacks.ros2.rmw_zenoh.interfaces import InterfaceError, Interfaces

_ATTEMPTS: Final = 20


class ZenohRouter:
    """A router at a port of 127.0.0.1, and the types of the stack that connects to it."""

    def __init__(self, session: zenoh.Session, port: int, interfaces: Interfaces) -> None:
        self.session = session
        self.port = port
        self.interfaces = interfaces

    @classmethod
    def open(
        cls, port: int = 0, *, distribution: str, definitions: Sequence[Path] = ()
    ) -> ZenohRouter:
        """Listen at ``port``, any free one for 0; a stack that runs already looks for the old one.

        ``definitions`` are folders whose interface definitions come before those shipped for
        ``distribution``. Raises :class:`LinkLost`.
        """
        try:
            interfaces = Interfaces(distribution, definitions)
        except InterfaceError as error:
            raise LinkLost(str(error)) from error
        problem: Exception = OSError("no port of 127.0.0.1 is free")
        for _ in range(1 if port else _ATTEMPTS):
            try:
                chosen = port or _free_port()
                return cls(open_session("router", listen=chosen), chosen, interfaces)
            except (OSError, zenoh.ZError) as error:
                # Somebody else may have been given the same port meanwhile.
                problem = error
        where = f"port {port} of 127.0.0.1" if port else "127.0.0.1"
        raise LinkLost(f"a Zenoh router cannot listen at {where}: {problem}") from problem

    @property
    def environment(self) -> Mapping[str, str]:
        """Environment variables with which a stack speaks ``rmw_zenoh`` and finds this router."""
        here = f'connect/endpoints=["tcp/127.0.0.1:{self.port}"]'
        return {
            "RMW_IMPLEMENTATION": "rmw_zenoh_cpp",
            "ZENOH_CONFIG_OVERRIDE": f'{here};listen/endpoints=["tcp/127.0.0.1:0"]',
            # Nodes wait for the router as long as it takes.
            "ZENOH_ROUTER_CHECK_ATTEMPTS": "0",
        }

    def close(self) -> None:
        """End the session; more than once does no harm."""
        if not self.session.is_closed():
            self.session.close()  # type: ignore[no-untyped-call]


def open_session(mode: str, *, listen: int = 0, connect: int = 0) -> zenoh.Session:
    """Open a session of ``mode`` router or peer on loopback; raises ``zenoh.ZError``."""
    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": mode,
        "listen/endpoints": [f"tcp/127.0.0.1:{listen}"],
        "connect/endpoints": [f"tcp/127.0.0.1:{connect}"] if connect else [],
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,  # else opening a router waits half a second, deaf but connectable
        # Only samples with a time are kept for those who come late.
        "timestamping/enabled": True,
        # It loses messages without a word on a busy machine, and segments of the killed stay.
        "transport/shared_memory/enabled": False,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port: int = free.getsockname()[1]
    return port
