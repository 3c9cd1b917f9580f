"""Security: who may ask the daemon what, the keys that prove it, and the limits for everybody.

Making keys imports the cryptography library; that is :mod:`daemon.security.authority`.
"""

from daemon.security._access import access_control
from daemon.security._holder import (
    VARIABLE,
    DaemonKeys,
    Holder,
    find_daemon_keys,
    find_holder,
    is_authority,
    keys_folder,
    read_holder,
    registered,
)
from daemon.security._register import Issued, Register
from daemon.security._rules import CLIENTS, RULES, Role, Rule, allowed, denial
from daemon.security._text import tamed

__all__ = [
    "CLIENTS",
    "RULES",
    "VARIABLE",
    "DaemonKeys",
    "Holder",
    "Issued",
    "Register",
    "Role",
    "Rule",
    "access_control",
    "allowed",
    "denial",
    "find_daemon_keys",
    "find_holder",
    "is_authority",
    "keys_folder",
    "read_holder",
    "registered",
    "tamed",
]
