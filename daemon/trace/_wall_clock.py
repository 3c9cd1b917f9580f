"""Copies of traces that say when their run began, which a run knows nothing of.

A trace is of simulated time, so that the same specification leaves the same bytes. The result of
the run has the time at which it was recorded, and a copy has it inside as well.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mcap.records import Attachment, Channel, Message, Metadata, Schema

from daemon.trace._mcap_writer import LIBRARY, PROFILE

if TYPE_CHECKING:
    from mcap.writer import Writer


def copy_with_wall_clock(source: Path, target: Path, started: float, *, worker: str = "") -> None:
    """Write a copy of a trace that says when its run began: ``started`` [s since 1970, UTC].

    The copy has the metadata ``wall_clock``, with the ``worker`` that executed the run. ``target``
    appears when it is whole.
    """
    # Not at import: readers and writers of traces need neither.
    from mcap.stream_reader import StreamReader
    from mcap.writer import Writer

    facts = {
        "started": datetime.fromtimestamp(started, UTC).isoformat(timespec="milliseconds"),
        "started_ns": str(round(started * 1e9)),
        "worker": worker,
    }
    target.parent.mkdir(parents=True, exist_ok=True)
    partial = target.with_name(f".{target.name}.part")
    try:
        with source.open("rb") as read, partial.open("wb") as copy:
            writer = Writer(copy, enable_data_crcs=True)
            writer.start(PROFILE, LIBRARY)
            writer.add_metadata("wall_clock", facts)
            _copy_records(StreamReader(read).records, writer)
            writer.finish()  # type: ignore[no-untyped-call]
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)


def _copy_records(records: Iterator[Any], writer: Writer) -> None:
    """Write everything of a file but its indexes again."""
    # The library counts ids anew in the order of registration.
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    for record in records:
        if isinstance(record, Message):
            writer.add_message(
                channels[record.channel_id],
                record.log_time, record.data, record.publish_time, record.sequence,
            )  # fmt: skip
        elif isinstance(record, Schema) and record.id not in schemas:
            schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
        elif isinstance(record, Channel) and record.id not in channels:
            channels[record.id] = writer.register_channel(
                record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
            )
        elif isinstance(record, Attachment):
            writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
        elif isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)
