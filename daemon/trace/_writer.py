"""Writer of traces: ROS 2 messages in CDR with simulated time; the same calls give the same bytes.

Messages are in the order of time, in the file and in its index, so that it can be played from a
pipe. Recent messages wait for the next chunk, because earlier ones may still arrive: plans wait,
and estimates take a while.

The writer leaves out messages that add nothing: joint states that repeat (see
:class:`~daemon.trace.JointSamples`), and plans and progress without a change. It limits the rate
of door frames and of topics with a period (see :class:`~daemon.trace.messages.Topic`).
"""

from __future__ import annotations

import functools
import hashlib
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import zstandard

from daemon.model import ros_messages as ros
from daemon.model.spec import RunSpec, TraceInfo
from daemon.trace import messages
from daemon.trace._mcap_reader import McapContents, read_mcap
from daemon.trace._mcap_writer import (
    McapWriter,
    MessageBlock,
    MessageRecords,
    encode_block,
    split_blocks,
)
from daemon.trace._model import Trace
from daemon.trace._reader import decode_trace, judged_layouts
from daemon.trace._recorder import Recorder, nanoseconds, utf8_text
from daemon.trace._signals import SampledSignal
from daemon.trace._views import encode_path, thin_plan
from daemon.trace.messages import JUDGED
from grammars.model.geometry import Floats
from grammars.model.scene import Scene
from grammars.text import codec
from grammars.text.files import sync_directory

PARTIAL: Final = ".partial"
"""Suffix of a trace until it is complete; it stays if the writer dies."""

_SECOND: Final = 1_000_000_000
_CHUNK: Final = 10 * _SECOND
"""Simulated time that a chunk covers [ns]."""
_LATEST_ARRIVAL: Final = 1_200_000_000
"""Longest delay [ns] of a message that still gets its place in the order. Plans wait for a second
and the next tick of the clock, estimates come within 0.1 s. A writer that dies loses at most a
chunk and this time, and verdicts during a run lag behind by as much."""
_WAITING_BYTES: Final = 8 << 20
"""Limit of the messages of one topic that wait for their chunk [bytes], so that a system cannot
fill the memory. Messages within the latest arrival time still wait."""
_PERIODS: Final = {topic.name: topic.period for topic in messages.TOPICS}
_COSTMAPS: Final = frozenset(topic.name for topic in messages.TOPICS if topic.is_costmap_report)
_MOST_COSTMAPS: Final = 64 << 20
"""Limit of a reported costmap in a trace [bytes before compression]. Costmaps of large buildings
are recorded less often to stay within the ``TOTAL_LIMIT`` of the reader."""
_LATEST: Final = 2.0**31
"""End of the times of ROS 2 [s], whose seconds are an int32."""


class TraceWriter(Recorder):
    """Recorder that writes one trace; a context manager.

    Times are simulated seconds in [0, 2**31). The file gets its name from :meth:`publish` or
    :meth:`close`. Without them it stays a ``.partial`` file, readable up to the last complete
    chunk. Values of a wrong shape, times out of range and another scene than the specified one
    raise ``ValueError``.
    """

    def __init__(
        self, path: Path, spec: RunSpec, scene: Scene, *, versions: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(spec, scene)
        packed = _compress_scene(scene, spec.scene)
        # Channels have numbers in the order of declaration: topics without one come last.
        topics = sorted(
            messages.topics_of(spec.robot), key=lambda topic: not topic.is_recorded(spec.sut)
        )
        self._ids = {topic.name: number for number, topic in enumerate(topics, start=1)}
        self._records: dict[str, MessageRecords] = {}
        self._next = dict.fromkeys(self._ids, 0)
        self._plan = b""
        self._waiting_plan: tuple[int, Floats] | None = None
        self._due = _CHUNK
        self._late: list[MessageBlock] = []
        self._judged: McapContents | None = None
        self._time, self._now = math.nan, 0
        self._path, self._partial = path, path.with_name(path.name + PARTIAL)
        # The file of a writer that died. If that writer is still alive, it goes on with a file
        # without a name; see _publish.
        self._partial.unlink(missing_ok=True)
        self._file = self._partial.open("xb")
        self._container = McapWriter(self._file)
        _write_preamble(self._container, spec, packed, versions or {})

    def clock(self, time: float) -> None:
        """Record the simulated time, and a plan that has waited for a second."""
        super().clock(time)
        self._write_plan(self._now)

    def plan(self, time: float, points: Floats) -> None:
        """Record a global plan (n, 2) in map if it has changed.

        Of several plans in a second, only the latest one is recorded, after that second.
        """
        now, thin = self._at(time), thin_plan(points)
        raw = thin.tobytes()
        if raw != self._plan:
            self._plan, self._waiting_plan = raw, (now, thin)
            self._write_plan(now)

    def _write_plan(self, now: int) -> None:
        if self._waiting_plan is not None and now >= self._next["/plan"]:
            at, points = self._waiting_plan
            self._records_of("/plan").add(at, encode_path(at, points))
            self._waiting_plan, self._next["/plan"] = None, now + _PERIODS["/plan"]

    def _sample(self, signal: SampledSignal, time: float, values: Sequence[Any]) -> None:
        # Mostly the same time as the sample before.
        signal.add(self._now if time == self._time else self._at(time), values)

    def _message(self, topic: str, time: float, encode: Callable[[int], bytes]) -> None:
        now = self._at(time)
        if now < self._next[topic]:
            return
        records, payload = self._records_of(topic), encode(now)
        records.add(now, payload)
        if period := _PERIODS[topic]:
            if topic in _COSTMAPS:
                period = max(
                    period, int(len(payload) * self._spec.limit * _SECOND / _MOST_COSTMAPS)
                )
            self._next[topic] = now + period
        if records.size > _WAITING_BYTES:
            self._flush(now - _LATEST_ARRIVAL)

    def _records_of(self, topic: str) -> MessageRecords:
        records = self._records.get(topic)
        if records is None:
            records = self._records[topic] = MessageRecords(self._ids[topic])
        return records

    def _latch(self, payloads: Mapping[str, bytes]) -> None:
        for topic, payload in payloads.items():
            self._records_of(topic).add(0, payload)
        self._flush()

    def attach(self, name: str, data: bytes) -> None:
        """Attach output of a system under test."""
        self._container.add_attachment(f"{messages.OUTPUT_PREFIX}{name}", "text/plain", data)

    def so_far(self, ended: str | None = None, note: str = "") -> Trace:
        """Return the trace recorded so far, without scans and plans, and change nothing in it.

        With ``ended`` and ``note`` the trace is that of a complete run, otherwise that of a run
        that was cut. The first call reads the file; later calls keep judged messages in memory.
        Raises :class:`TraceError` if another process has replaced the file.
        """
        if self._judged is None:
            self._file.flush()
            self._judged = read_mcap(self._partial, JUDGED.__contains__, layouts=judged_layouts())
            self._judged.cut = ""
        pending, last = [*self._late, *self._peek_judged()], self._container.last
        for block in pending:
            last = max(last, int(block.times.max(initial=0)))
        contents = self._judged.copy()
        self._keep(contents, pending)
        contents.metadata["outcome"] = {} if ended is None else _outcome(ended, note, last)
        return decode_trace(contents, self._spec, self._scene)

    def _peek_judged(self) -> Iterator[MessageBlock]:
        """Yield the judged messages that are not encoded yet."""
        for signal in (*self._signals.values(), *self._contacts.values()):
            if signal.topics & JUDGED:
                times, columns = signal.peek()
                for layout in signal.layouts:
                    if layout.topic in JUDGED:
                        yield encode_block(layout, self._ids[layout.topic], times, columns)
        for topic in JUDGED & self._records.keys():
            yield self._records[topic].peek()

    def _keep(self, contents: McapContents, blocks: Sequence[MessageBlock]) -> None:
        """Add the judged ones of encoded messages to the contents of a file."""
        names = {number: topic for topic, number in self._ids.items() if topic in JUDGED}
        for block in blocks:
            if block.channel in names and len(block.times):
                contents.add(names[block.channel], block.data, block.offsets, block.sizes)

    def finish(self, ended: str, note: str = "") -> Path:
        """Write the end of the run and return the temporary path of the complete recording.

        ``ended`` and ``note`` are the reason of the end. Later calls cannot record anything.
        """
        self._keep_last()
        self._flush()
        outcome = _outcome(ended, note, self._container.last)
        self._container.add_metadata("outcome", outcome)
        self._container.finish()
        self._file.flush()
        return self._partial

    def add_verdicts(self, data: bytes) -> None:
        """Append the verdicts to a finished recording, as ``verdicts.json``."""
        self._container.reopen()
        self._container.add_attachment(messages.VERDICTS, "application/json", data)
        self._container.finish()

    def publish(self) -> TraceInfo:
        """Give a finished recording its name."""
        self._file.flush()
        # Before the rename: a power cut must not leave an empty file with the final name.
        os.fsync(self._file.fileno())
        self._publish()
        container = self._container
        return TraceInfo(container.sha256, container.size, container.messages)

    def close(self, ended: str, note: str = "") -> TraceInfo:
        """Finish the recording and give it its name, without verdicts."""
        self.finish(ended, note)
        return self.publish()

    def _publish(self) -> None:
        """Rename the file; raises ``FileExistsError`` if another writer has replaced it."""
        mine = os.fstat(self._file.fileno())
        self._file.close()
        there = self._partial.stat()
        if (mine.st_dev, mine.st_ino) != (there.st_dev, there.st_ino):
            raise FileExistsError(f"{self._partial} is being written by another process")
        self._partial.replace(self._path)
        sync_directory(self._path.parent)

    def __enter__(self) -> TraceWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if not self._file.closed:
            with self._file:
                if not self._container.finished:
                    self._keep_last()
                    self._flush()

    def _at(self, time: float) -> int:
        """Return a time in nanoseconds, and write a chunk every ten seconds."""
        if time == self._time:
            return self._now
        if not 0.0 <= time < _LATEST:
            raise ValueError(f"a recorded time must be in [0, 2**31) seconds, not {time!r}")
        now = nanoseconds(time)
        if now >= self._due:
            self._flush(now - _LATEST_ARRIVAL)
            self._due = (now // _CHUNK + 1) * _CHUNK
        self._time, self._now = time, now
        return now

    def _keep_last(self) -> None:
        """Record the joint states and the plan that still wait."""
        for signal in self._signals.values():
            signal.keep_last()
        self._next["/plan"] = 0
        self._write_plan(0)

    def _flush(self, before: int | None = None) -> None:
        """Write the messages earlier than ``before`` [ns], or all of them."""
        blocks = [
            encode_block(layout, self._ids[layout.topic], times, columns)
            for signal in (*self._signals.values(), *self._contacts.values())
            for layout, times, columns in signal.messages()
        ]
        blocks += [records.drain() for records in self._records.values()]
        # Contacts of one instant are in the order of the first contacts of the pairs in a chunk.
        self._contacts.clear()
        early, self._late = split_blocks([*self._late, *blocks], before)
        if self._judged is not None:
            self._keep(self._judged, early)
        self._container.add_chunk(early)
        self._file.flush()


def _outcome(ended: str, note: str, last: int) -> dict[str, str]:
    """Return the metadata of the end; ``last`` [ns] is the time of the latest message."""
    return {
        "ended": utf8_text(ended),
        "complete": "true",
        "valid_until": repr(last / _SECOND),
        "note": utf8_text(note),
    }


def _write_preamble(
    container: McapWriter, spec: RunSpec, scene: bytes, versions: Mapping[str, str]
) -> None:
    """Declare the topics and write the identity of the run, before all messages."""
    for topic in messages.topics_of(spec.robot):
        if not topic.is_recorded(spec.sut):
            continue
        qos = {"offered_qos_profiles": messages.latched_qos() if topic.latched else ""}
        container.add_channel(topic.name, topic.kind, ros.schema(topic.kind), qos)
    text = codec.to_json(spec)
    container.add_attachment("spec.json", "application/json", text)
    container.add_attachment("scene.json.zst", "application/zstd", scene)
    facts = {
        "digest": spec.digest,
        "sha256": hashlib.sha256(text).hexdigest(),
        "label": spec.label,
        "campaign": spec.campaign,
        "scenario": spec.scenario,
        "sut": spec.sut.name,
        "repeat": str(spec.repeat),
        "seed": str(spec.seed),
        "limit": repr(spec.limit),
        "scene": spec.scene,
        "robot": spec.robot.name,
        "mission": spec.mission.name,
    }
    container.add_metadata("run", facts)
    container.add_metadata("versions", {"engine": spec.engine, **dict(sorted(versions.items()))})


def _compress_scene(scene: Scene, digest: str) -> bytes:
    """Return the scene as compressed JSON; raises ``ValueError`` for a wrong digest."""
    data = codec.to_json(scene)
    actual = hashlib.sha256(data).hexdigest()
    if actual != digest:
        raise ValueError(f"scene {actual[:12]} given, {digest[:12]} specified")
    return _compressed(data)


# Level 9 and not 1 as for messages: it runs once per scene and process, and every trace has a copy.
@functools.lru_cache(maxsize=4)
def _compressed(data: bytes) -> bytes:
    return zstandard.ZstdCompressor(level=9).compress(data)
