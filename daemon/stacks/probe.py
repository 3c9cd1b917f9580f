"""Trying in a child process whether a system under test that plugs in can be made.

Its factory, and the import before, are code of other people: it may hang, leave the interpreter,
crash or print. The child is ended whatever it does, and what happened is told in words.
"""

from __future__ import annotations

import faulthandler
import os
import re
import signal
import sys
import sysconfig
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import IO, Any, Final

from daemon.model.attachments import SutMissing
from daemon.stacks.findings import ParameterError, ParameterFinding, ParameterFindings
from daemon.supervision.guardian import end_guarded, guard
from daemon.supervision.output_file import OutputFile
from grammars.text import codec
from grammars.text.terminal_text import printable

PATIENCE: Final = 10.0
"""Seconds of wall clock in which it has to be made."""
_LOOK: Final = 0.5
"""So long before the end [s] it is written down where the child is."""
_END: Final = 5.0
"""Seconds in which a child ends that has closed its pipe."""
_POLL: Final = 0.005
_LONGEST_LINE: Final = 60
_SHOWN_OUTPUT: Final = 64 * 1024
_FRAME: Final = re.compile(r'^  File "(?P<file>[^"]+)", line (?P<line>\d+) in ', re.MULTILINE)
_NOT_THEIRS: Final = (
    sysconfig.get_path("stdlib") + "/",
    str(Path(__file__).parents[2] / "daemon") + "/",
    "<frozen",
)


@dataclass(frozen=True, slots=True)
class ProbeAnswer:
    """What the child has found: nothing, or that it is ``missing``, or what is ``wrong``.

    ``problems`` instead where the plug-in says at which parameters.
    """

    missing: str = ""
    wrong: str = ""
    problems: tuple[ParameterFinding, ...] = ()


def check_plugged(
    make: Callable[[Mapping[str, Any]], object],
    name: str,
    parameters: Mapping[str, Any],
    *,
    patience: float = PATIENCE,
) -> ParameterFindings:
    """Return what there is to say about a system under test that ``make`` makes.

    ``name`` is what messages call it. Raises what ``make`` raises, ``ValueError`` and its
    subclasses, and ``ValueError`` as well when it does not return within ``patience`` seconds of
    wall clock or ends the process.
    """
    context = get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile() as places:
        output = Path(folder) / "output"
        process = context.Process(
            target=_probe, args=(make, parameters, theirs, output, places, patience), daemon=True
        )
        with warnings.catch_warnings():
            # From Python 3.12 on a fork beside threads is warned of: the one thing this child
            # shares with them is what it is forked for, modules that are loaded already.
            warnings.simplefilter("ignore", DeprecationWarning)
            process.start()
        theirs.close()
        try:
            ready = wait([ours, process.sentinel], patience)
            answer = _read_answer(ours)
            # What ends closes its pipe first: only then can it be said how it ended.
            ended = answer is None and bool(ready) and _ends(process)
        finally:
            code = _end(process)
            ours.close()
        if answer is None:
            silence = _silence(code if ended else None, patience, _place(places))
            raise ValueError(f"{name} {silence}")
        said = _lines(output)
    if answer.missing:
        raise SutMissing(answer.missing)
    if answer.problems:
        raise ParameterError(answer.problems)
    if answer.wrong:
        raise ValueError(answer.wrong)
    return ParameterFindings((_noise(name, said),)) if said else ParameterFindings()


def _probe(
    make: Callable[[Mapping[str, Any]], object],
    parameters: Mapping[str, Any],
    wire: Connection,
    output: Path,
    places: IO[bytes],
    patience: float,
) -> None:
    """Try it in this process, which is one of its own; answer through ``wire``."""
    guard(output)  # what it starts is ended with it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.stdout = sys.stderr = os.fdopen(os.dup(1), "w", buffering=1, errors="replace")
    faulthandler.enable(places)
    faulthandler.dump_traceback_later(max(patience - _LOOK, 0.5 * patience), file=places)
    try:
        make(parameters)
    except SutMissing as error:
        answer = ProbeAnswer(missing=str(error))
    except ParameterError as error:
        answer = ProbeAnswer(problems=error.problems)
    except ValueError as error:
        answer = ProbeAnswer(wrong=codec.reading_error(error) or "ValueError without a word")
    else:
        answer = ProbeAnswer()
    sys.stdout.flush()
    wire.send_bytes(codec.to_json(answer))


def _read_answer(wire: Connection) -> ProbeAnswer | None:
    """Return what the child said; nothing of a child that has said nothing, or nonsense."""
    try:
        return codec.from_json(ProbeAnswer, wire.recv_bytes()) if wire.poll() else None
    except (EOFError, OSError, ValueError):
        return None


def _ends(process: BaseProcess) -> bool:
    """Whether a child that has closed its pipe has ended, or does so at once."""
    assert process.pid is not None
    deadline = time.monotonic() + _END
    # Looked at without taking notice of it: until then its number is nobody else's.
    while os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        if time.monotonic() > deadline:
            return False
        time.sleep(_POLL)
    return True


def _end(process: BaseProcess) -> int:
    """End the child with all it has started; return its exit code, SIGKILL's if it still ran."""
    end_guarded(process)
    code = process.exitcode
    process.close()
    return code or 0


def _silence(code: int | None, patience: float, place: str) -> str:
    """Say what became of a child without an answer."""
    if code is None:
        return f"was not made within {patience:g} s{place}: what takes longer belongs into start()"
    if code < 0:
        known = {int(number): number.name for number in signal.Signals}
        return f"crashed its process by {known.get(-code, f'signal {-code}')}{place} while made"
    return f"ended its process with code {code} while it was made: raise ValueError instead"


def _place(places: IO[bytes]) -> str:
    """Return where it was, as far as that is known: ``(file:line)``."""
    places.seek(0)
    for frame in _FRAME.finditer(places.read().decode("utf-8", "replace")):
        file = frame["file"]
        if "site-packages" in file or not file.startswith(_NOT_THEIRS):
            return f" ({file}:{frame['line']})"
    return ""


def _lines(output: Path) -> list[str]:
    text = OutputFile.read(output)[:_SHOWN_OUTPUT].decode("utf-8", "replace")
    return [line.strip() for line in printable(text).splitlines() if line.strip()]


def _noise(name: str, said: list[str]) -> ParameterFinding:
    first = said[0]
    quoted = first if len(first) <= _LONGEST_LINE else first[: _LONGEST_LINE - 1] + "…"
    more = f" and {len(said) - 1} more" if len(said) > 1 else ""
    return ParameterFinding(
        (),
        f'{name} prints while it is made: "{quoted}"{more}',
        "nobody sees that in a run: say it by the events of a Decision",
    )
