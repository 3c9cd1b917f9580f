"""Copies of traces for people and their tools: with the wall clock that a run knows nothing of.

A trace is of simulated time, so that the same specification leaves the same bytes. When it was
recorded stands in the result of the run; a copy has it inside as well.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from mcap.records import Attachment, Channel, Message, Metadata, Schema

from daemon.model import ros_messages as ros
from daemon.trace._mcap_writer import LIBRARY, PROFILE
from daemon.trace.messages import WALL_CLOCK, WALL_STAMPS

if TYPE_CHECKING:
    from mcap.writer import Writer

_SECOND: Final = 1_000_000_000


def copy_with_wall_clock(
    source: Path, target: Path, started: float, *, worker: str = "", stamps: bool = False
) -> None:
    """Write a copy of a trace that says when its run began: ``started`` [s since 1970, UTC].

    That is the metadata ``wall_clock``, with the ``worker`` that executed it. With ``stamps`` the
    times of messages and the stamps in them are by the wall clock too, as if simulated time had
    passed as fast: such a copy is for players, and not judged. ``target`` appears when it is whole.
    """
    # Not at import: whoever reads or writes traces needs neither.
    from mcap.stream_reader import StreamReader
    from mcap.writer import Writer

    begun = round(started * _SECOND)
    facts = {
        "started": datetime.fromtimestamp(started, UTC).isoformat(timespec="milliseconds"),
        "started_ns": str(begun),
        "worker": worker,
        "stamps": WALL_STAMPS if stamps else "simulated",
    }
    target.parent.mkdir(parents=True, exist_ok=True)
    partial = target.with_name(f".{target.name}.part")
    try:
        with source.open("rb") as read, partial.open("wb") as written:
            writer = Writer(written, enable_data_crcs=True)
            writer.start(PROFILE, LIBRARY)
            writer.add_metadata(WALL_CLOCK, facts)
            _copy_records(StreamReader(read).records, writer, begun if stamps else 0)
            writer.finish()  # type: ignore[no-untyped-call]
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)


def _copy_records(records: Iterator[Any], writer: Writer, shift: int) -> None:
    """Write everything of a file but its indexes again, messages ``shift`` [ns] later."""
    # The library counts ids anew in the order of registration.
    schemas: dict[int, tuple[int, str]] = {}
    channels: dict[int, tuple[int, str]] = {}
    for record in records:
        if isinstance(record, Message):
            channel, kind = channels[record.channel_id]
            data = _shift_stamps(record.data, kind, shift) if shift else record.data
            writer.add_message(
                channel, record.log_time + shift, data, record.publish_time + shift, record.sequence
            )
        elif isinstance(record, Schema) and record.id not in schemas:
            found = writer.register_schema(record.name, record.encoding, record.data)
            schemas[record.id] = found, record.name
        elif isinstance(record, Channel) and record.id not in channels:
            schema, kind = schemas[record.schema_id]
            found = writer.register_channel(
                record.topic, record.message_encoding, schema, record.metadata
            )
            channels[record.id] = found, kind
        elif isinstance(record, Attachment):
            writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
        elif isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)


def _shift_stamps(data: bytes, kind: str, shift: int) -> bytes:
    message = ros.deserialize(data, kind)
    return ros.serialize(_shifted(message, shift), kind)


def _shifted(value: Any, shift: int) -> Any:
    """Return a message with all times in it ``shift`` [ns] later."""
    if isinstance(value, list):
        return [_shifted(each, shift) for each in value]
    kind = getattr(value, "__msgtype__", "")
    if kind == "builtin_interfaces/msg/Time":
        return ros.time(value.sec * _SECOND + value.nanosec + shift)
    for field in dataclasses.fields(value) if kind else ():
        found = getattr(value, field.name)
        if isinstance(found, list) or dataclasses.is_dataclass(found):
            setattr(value, field.name, _shifted(found, shift))
    return value
