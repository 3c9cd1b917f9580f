"""Loading a plan from a file or a text."""

from __future__ import annotations

from pathlib import Path

from grammars.diagnostics import Diagnostic, InputError, Where
from grammars.floorplan.model import FloorPlan


def load_floorplan(path: str | Path) -> FloorPlan:
    """Read and compile a ``.fpm`` file (UTF-8).

    Raises :class:`InputError` with everything that is wrong with it; warnings are in the plan.
    """
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(Diagnostic(Where(str(path)), f"cannot read the plan: {reason}")) from error
    except UnicodeDecodeError as error:
        raise InputError(
            Diagnostic(Where(str(path)), "the plan is not UTF-8 text", "save it as UTF-8")
        ) from error
    return parse_floorplan(text, str(path))


def parse_floorplan(text: str, file: str = "<text>") -> FloorPlan:
    """Compile the text of a plan; ``file`` is its name in diagnostics.

    Raises :class:`InputError` with everything that is wrong with it; warnings are in the plan.
    """
    from grammars.floorplan._compile import compile_plan
    from grammars.floorplan._source import Source
    from grammars.floorplan._syntax import parse

    source = Source(text, file)
    return compile_plan(parse(source), source)
