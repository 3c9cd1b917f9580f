"""What ``mcap doctor --strict-message-order`` complains about, and what an index must say.

The command line of the format is a program in Go; these are its checks, by the mcap library's own
reader of streams, which also holds every checksum against the bytes.
"""

import itertools
import zlib
from collections import Counter
from types import SimpleNamespace

from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.stream_reader import StreamReader, breakup_chunk


def complaints(path):
    """Return everything that is wrong with a file, in words."""
    return list(_complaints(path))


def _complaints(path):
    found, summary, ended = SimpleNamespace(first=1 << 64, last=0, counts=Counter()), [], False
    found.schemas, found.channels, found.chunks, found.lengths = {}, {}, {}, {}
    found.attachments, found.metadata = [], []
    offsets = {}
    expected = set()
    data = path.read_bytes()
    with path.open("rb") as stream:
        at = 8
        reader = StreamReader(stream, emit_chunks=True, validate_crcs=True)
        for record in reader.records:
            length = reader._stream.count - at
            if isinstance(record, records.Header):
                if record.profile not in ("", "ros1", "ros2") or not record.library:
                    yield f"header {record}"
            elif isinstance(record, records.Chunk):
                found.chunks[at], found.lengths[at] = record, length
                if expected:
                    yield f"{len(expected)} messages before {at} are in no index"
                expected.clear()
                yield from _chunk(found, record, expected)
            elif isinstance(record, records.MessageIndex):
                times = [time for time, _ in record.records]
                if times != sorted(times):
                    yield f"the index of channel {record.channel_id} is not in order"
                for time, offset in record.records:
                    entry = (record.channel_id, time, offset)
                    if entry not in expected:
                        yield f"index entry {entry} is of no message"
                    else:
                        expected.remove(entry)
            elif isinstance(record, records.Attachment):
                # The library writes the checksum of what it was given, and reads over it.
                if _encoded(record) != data[at : at + length]:
                    yield f"attachment {record.name} with another checksum"
                found.attachments.append(record.name)
                offsets[at] = (length, 9)
            elif isinstance(record, records.Metadata):
                found.metadata.append(record.name)
                offsets[at] = (length, 12)
            elif isinstance(record, records.DataEnd):
                ended = True
                if not record.data_section_crc:
                    yield "no checksum of the data"
            elif isinstance(record, records.Footer):
                if zlib.crc32(data[record.summary_start : -12]) != record.summary_crc:
                    yield "a summary with another checksum"
            elif ended:
                summary.append(record)
            else:
                yield f"{type(record).__name__} outside of a chunk"
            at += length
    if not ended:
        yield "no end of the data"
    if expected:
        yield f"{len(expected)} messages are in no index"
    yield from _summary(found, summary, offsets)


def _chunk(found, chunk, expected):
    """Check the records in a chunk; ``expected`` takes what its indexes have to say."""
    times, at = [], 0
    for record in breakup_chunk(chunk, validate_crc=True):
        if isinstance(record, records.Schema):
            if record.id in found.schemas or not record.id or not record.encoding:
                yield f"schema {record.id}"
            found.schemas[record.id] = record
        elif isinstance(record, records.Channel):
            if record.id in found.channels or record.schema_id not in found.schemas:
                yield f"channel {record.id}"
            found.channels[record.id] = record
        elif isinstance(record, records.Message):
            if record.channel_id not in found.channels:
                yield f"a message on unknown channel {record.channel_id}"
            if record.log_time < found.last:
                topic = found.channels[record.channel_id].topic
                yield f"a message of {record.log_time} on {topic} follows one of {found.last}"
            times.append(record.log_time)
            found.first = min(found.first, record.log_time)
            found.last = max(found.last, record.log_time)
            found.counts[record.channel_id] += 1
            expected.add((record.channel_id, record.log_time, at))
        at += len(_encoded(record))
    if times and (min(times), max(times)) != (chunk.message_start_time, chunk.message_end_time):
        yield "a chunk that says other times"


def _encoded(record):
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def _summary(found, summary, offsets):
    by_kind = {}
    for record in summary:
        by_kind.setdefault(type(record), []).append(record)
    for kind, known in ((records.Schema, found.schemas), (records.Channel, found.channels)):
        if {record.id: record for record in by_kind.get(kind, [])} != known:
            yield f"the summary has other {kind.__name__.lower()}s than the data"
    (statistics,) = by_kind[records.Statistics]
    if statistics != records.Statistics(
        attachment_count=len(found.attachments),
        channel_count=len(found.channels),
        channel_message_counts=dict(found.counts),
        chunk_count=len(found.chunks),
        message_count=found.counts.total(),
        message_start_time=found.first,
        message_end_time=found.last,
        metadata_count=len(found.metadata),
        schema_count=len(found.schemas),
    ):
        yield f"wrong statistics: {statistics}"
    indexes = by_kind.get(records.ChunkIndex, [])
    if [index.chunk_start_offset for index in indexes] != list(found.chunks):
        yield "chunks without an index, or indexes without a chunk"
        return
    for index in indexes:
        chunk = found.chunks[index.chunk_start_offset]
        for name in ("message_start_time", "message_end_time", "compression", "uncompressed_size"):
            if getattr(index, name) != getattr(chunk, name):
                yield f"a chunk index with another {name}"
        if (index.chunk_length, index.compressed_size) != (
            found.lengths[index.chunk_start_offset],
            len(chunk.data),
        ):
            yield "a chunk index with another length"
    named = {(index.offset, index.length, 9) for index in by_kind.get(records.AttachmentIndex, [])}
    named |= {(index.offset, index.length, 12) for index in by_kind.get(records.MetadataIndex, [])}
    if named != {(at, length, opcode) for at, (length, opcode) in offsets.items()}:
        yield "attachments or metadata without an index, or indexes without them"
    for before, after in itertools.pairwise(indexes):
        if after.message_start_time < before.message_end_time:
            yield "chunks that overlap in time"
