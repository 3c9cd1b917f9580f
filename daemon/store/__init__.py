"""Where traces lie and how they travel: stores by URL, verified parts, copies at hand."""

from daemon.store._chunks import (
    accept_part,
    add_part,
    is_file_of,
    make_folder,
    packed,
    read_part,
    sha256_of,
    size_of,
    unpacked,
)
from daemon.store._copies import (
    Recorded,
    Source,
    Told,
    bring,
    local_copy,
    recorded,
    user_cache,
)
from daemon.store._marker import Marker, leave_marker, read_marker
from daemon.store._shelf import StoreUnusable, get, prove, put, remove
from daemon.store._urls import checked_store, is_url, stored_url

__all__ = [
    "Marker",
    "Recorded",
    "Source",
    "StoreUnusable",
    "Told",
    "accept_part",
    "add_part",
    "bring",
    "checked_store",
    "get",
    "is_file_of",
    "is_url",
    "leave_marker",
    "local_copy",
    "make_folder",
    "packed",
    "prove",
    "put",
    "read_marker",
    "read_part",
    "recorded",
    "remove",
    "sha256_of",
    "size_of",
    "stored_url",
    "unpacked",
    "user_cache",
]
