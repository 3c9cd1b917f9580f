"""Why a daemon was not reached over TLS, in words: Zenoh only says that it was not."""

from __future__ import annotations

import socket
import ssl
from typing import Final

from daemon.batch.security._keys import CA_FILE, CERTIFICATE_FILE, KEY_FILE, Credentials

_PATIENCE: Final = 2.0
"""Seconds for a TCP connection and a handshake; the daemon has failed to answer already."""


def handshake_problem(endpoint: str, credentials: Credentials) -> str:
    """Try a TLS handshake at ``endpoint`` and say what keeps it from succeeding.

    Empty when nobody listens there, or when nothing is wrong.
    """
    host, _, port = endpoint.removeprefix("tls/").rpartition(":")
    host = host.strip("[]")
    try:
        context = ssl.create_default_context(cafile=str(credentials.folder / CA_FILE))
        context.load_cert_chain(
            credentials.folder / CERTIFICATE_FILE, credentials.folder / KEY_FILE
        )
        with (
            socket.create_connection((host, int(port)), timeout=_PATIENCE) as plain,
            context.wrap_socket(plain, server_hostname=host) as wrapped,
        ):
            # TLS 1.3: what the other side has against our certificate comes after the handshake.
            wrapped.settimeout(_PATIENCE / 10)
            wrapped.recv(1)
    except ssl.SSLCertVerificationError as error:
        return (
            f"who listens there does not prove to be the daemon of these keys: "
            f"{error.verify_message.rstrip('.')} (keys of {credentials.folder})"
        )
    except ssl.SSLError as error:
        reason = (error.reason or str(error)).replace("_", " ").lower()
        whose = f'the key "{credentials.name}" in {credentials.folder}'
        return f"who listens there does not take {whose}: {reason}"
    except OSError:
        return ""
    return ""
