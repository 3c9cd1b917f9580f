"""Security: who may ask the daemon what, the keys that prove it, and the limits for everybody.

Making keys imports the cryptography library; that is :mod:`daemon.batch.security.authority`.
"""

from daemon.batch.security._access_control import access_control
from daemon.batch.security._keys import (
    KEYS_VARIABLE,
    Credentials,
    DaemonCredentials,
    IssuedKey,
    KeyRegister,
    find_credentials,
    find_daemon_credentials,
    is_authority,
    keys_folder,
    load_register,
    read_credentials,
)
from daemon.batch.security._rules import (
    CLIENT_ROLES,
    VERB_RULES,
    Role,
    VerbRule,
    allowed_verbs,
    denial_text,
    strip_control_characters,
)

__all__ = [
    "CLIENT_ROLES",
    "KEYS_VARIABLE",
    "VERB_RULES",
    "Credentials",
    "DaemonCredentials",
    "IssuedKey",
    "KeyRegister",
    "Role",
    "VerbRule",
    "access_control",
    "allowed_verbs",
    "denial_text",
    "find_credentials",
    "find_daemon_credentials",
    "is_authority",
    "keys_folder",
    "load_register",
    "read_credentials",
    "strip_control_characters",
]
