"""Security: rights of roles, keys that prove them, and cleaning of texts.

Making keys imports the cryptography library; that is :mod:`daemon.batch.security.authority`.
"""

from daemon.batch.security._access_control import (
    access_control,
    denial_text,
    strip_control_characters,
)
from daemon.batch.security._keys import (
    Credentials,
    DaemonCredentials,
    IssuedKey,
    KeyList,
    KeyRegister,
    find_credentials,
    find_daemon_credentials,
    handshake_problem,
    is_authority,
    keys_folder,
    load_register,
)
