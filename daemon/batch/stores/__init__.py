"""Places of traces and their travels: a store by URL, parts of files, copies on this machine."""

from daemon.batch.stores._marker import Marker, read_marker, write_marker
from daemon.batch.stores._store import check_store_url, copy_between, is_url
from daemon.batch.stores._transfer import (
    ByteProgress,
    TraceReference,
    append_part,
    copy_trace,
    download,
    file_sha256,
    file_size,
    local_copy,
    matches_digest,
    read_part,
    trace_reference,
    trim_cache,
    upload,
)

__all__ = [
    "ByteProgress",
    "Marker",
    "TraceReference",
    "append_part",
    "check_store_url",
    "copy_between",
    "copy_trace",
    "download",
    "file_sha256",
    "file_size",
    "is_url",
    "local_copy",
    "matches_digest",
    "read_marker",
    "read_part",
    "trace_reference",
    "trim_cache",
    "upload",
    "write_marker",
]
