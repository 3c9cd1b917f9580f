"""Options that several commands share, the parsers of their amounts, and commands for typer."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, Final, TypeAlias, get_args, get_origin, get_type_hints

import typer

from daemon.batch.amounts import parse_time
from grammars.text.diagnostics import InputError, Where, closest
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, write_json
from scenario_tui.cli.output import say, show_progress
from scenario_tui.source import DaemonTarget

_LISTED: Final = 5
"""Campaign files that a message lists if none is close to the typed name."""


def parse_duration(text: str) -> float:
    """Return ``10min`` in seconds; raises ``ValueError``."""
    return parse_time(text, "a time", "10min")


def parse_wall(text: str) -> float:
    """Return a wall clock limit in seconds: ``90``, ``90s`` or ``2min``; raises ``ValueError``."""
    seconds = parse_duration(f"{text}s" if text.strip().replace(".", "", 1).isdigit() else text)
    if seconds <= 0.0:
        raise ValueError("a limit must be longer than 0 s")
    return seconds


def parse_ratio(text: str) -> float:
    """Return ``20 %`` as 0.2; raises ``ValueError``."""
    from grammars.text.quantity import read_as

    ratio = read_as(text, "ratio")
    if ratio < 0.0:
        raise ValueError(f'"{text}" is negative')
    return ratio


def check_writable(path: Path, option: str) -> None:
    """Refuse a file that cannot be written, as wrong usage of ``option``."""
    why = ""
    if path.is_dir():
        why = "is a folder: name a file"
    elif lacking := why_no_folder(path.parent):
        why = f"cannot be written: {path.parent} {lacking}"
    elif not os.access(path if path.exists() else path.parent, os.W_OK):
        why = "cannot be written: you lack the permission"
    if why:
        raise typer.BadParameter(f"{path} {why}", param_hint=option)


def why_no_folder(path: Path) -> str:
    """Return why a path is not a folder; empty for a folder."""
    if path.is_dir():
        return ""
    return "is not a folder" if path.exists() else "does not exist"


def check_folder(path: Path, option: str) -> None:
    """Refuse a path with a file in place of a folder, as wrong usage of ``option``."""
    nearest = next(one for one in (path, *path.parents) if one.exists())
    if not nearest.is_dir():
        why = f"{nearest} is a file: name a new or existing folder"
        raise typer.BadParameter(why, param_hint=option)


def refuse_typed(context: typer.Context, names: Sequence[str], why: str) -> None:
    """Refuse parameters that were typed although they do not apply."""
    sources = {name: context.get_parameter_source(name) for name in names}
    typed = [
        parameter.opts[0]
        for parameter in context.command.params
        if (source := sources.get(parameter.name or "")) and source.name == "COMMANDLINE"
    ]
    if typed:
        raise typer.BadParameter(why, param_hint=", ".join(typed))


def parse_endpoint(text: str) -> str:
    """Return a typed endpoint, a path as the endpoint of a socket; raises ``ValueError``."""
    from daemon.batch import paths

    endpoint = paths.parse_endpoint(text)
    if text and not paths.is_endpoint(endpoint):
        raise ValueError(
            f"{text!r} is not an endpoint: write tcp/<host>:<port>, tls/<host>:<port> "
            "or the path of a socket"
        )
    return endpoint


def check_campaign_file(path: Path) -> Path:
    """Return the path of a campaign file; raises :class:`InputError` with suggestions."""
    if not path.exists():
        raise InputError.at(Where(str(path)), "no such file", _campaign_hint(path))
    return path


def refuse_missing_file(name: str) -> None:
    """Check that a name with the ending of a campaign file exists as a file."""
    if name.endswith((".yaml", ".yml")):
        check_campaign_file(Path(name))


def _campaign_hint(path: Path) -> str:
    from scenario_tui.campaign_files import find_campaigns

    files = find_campaigns(Path())
    # Without the endings, by which any two of them would be similar.
    names = {file.stem: file for file in path.parent.glob("*.y*ml")}
    for file in files:
        for word in (str(file.with_suffix("")), file.stem, file.parent.name):
            names.setdefault(word, file)
    typed = (str(path.with_suffix("")), path.stem)
    if word := next(filter(None, (closest(one, names) for one in typed)), ""):
        return f"did you mean {names[word]}?"
    if not files:
        return "this folder has no campaign file: `scenario new my-tests` writes one"
    more = f" and {len(files) - _LISTED} more" if len(files) > _LISTED else ""
    return f"campaign files here: {', '.join(map(str, files[:_LISTED]))}{more}"


_COMMON: Final = "Common options"
"""Panel of the help for options of many commands."""


def out_folder(about: str) -> Any:
    """Return the option ``--out DIR``, which refuses files."""
    return typer.Option("--out", "-o", metavar="DIR", callback=_check_out, help=about)


def _check_out(path: Path | None) -> Path | None:
    if path is not None:
        check_folder(path, "--out")
    return path


Connect: TypeAlias = Annotated[
    str,
    typer.Option(
        "--connect",
        "-c",
        metavar="ENDPOINT",
        parser=parse_endpoint,
        rich_help_panel=_COMMON,
        help="Endpoint of the daemon, tls/host:port. Default: $SCENARIO_CONNECT, "
        "then the daemon of this machine.",
    ),
]
State: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        rich_help_panel=_COMMON,
        help="State directory of the daemon of this machine. Default: $SCENARIO_STATE, "
        "then your user state folder.",
    ),
]
Keys: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        rich_help_panel=_COMMON,
        help="Folder of keys, for tls/host:port. Default: $SCENARIO_KEYS, then the keys in your "
        "settings.",
    ),
]
Baseline: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="CAMPAIGN",
        help="Fail if results are worse than those of this campaign, folder of traces, file of "
        "results (JSON), or last-green. Default: the gate of the campaign file.",
        autocompletion=completion.offers(
            completion.words("last-green"), completion.campaigns, completion.files(".json")
        ),
    ),
]
WorseBy: TypeAlias = Annotated[
    float | None,
    typer.Option(
        metavar="RATIO",
        parser=parse_ratio,
        help="Allowed loss of a margin or a duration. Default: the gate's, or 10 %.",
    ),
]
Base = Annotated[
    str,
    typer.Option(
        metavar="IRI",
        help="For JSON-LD: base of relative identifiers. Default: the file's address.",
    ),
]
AsJson: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--json", rich_help_panel=_COMMON, help="Write one JSON object to standard output."
    ),
]
Slots: TypeAlias = Annotated[
    int | None,
    typer.Option("--slots", "-j", min=1, max=1024, help="Parallel runs. Default: one per core."),
]
Wall: TypeAlias = Annotated[
    float | None,
    typer.Option(
        metavar="TIME",
        parser=parse_wall,
        help="Wall clock limit of a run, 90s or 10min; a run that exceeds it ends as an error. "
        "Default: ten times its simulated limit, at least 5min.",
    ),
]


def _check_table(path: Path | None) -> Path | None:
    if path is not None:
        from daemon.analysis.table import table_writer

        check_writable(path, "--table")
        table_writer(path)
    return path


TableFile: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Write a row for each run and oracle: .parquet, .csv or .arrow.",
        callback=_check_table,
    ),
]
Processes: TypeAlias = Annotated[
    int | None,
    typer.Option(
        "--processes", "-j", min=1, max=1024, help="Parallel processes. Default: one per core."
    ),
]
CampaignFile: TypeAlias = Annotated[
    Path,
    typer.Argument(
        metavar="CAMPAIGN.yaml",
        callback=check_campaign_file,
        help="The campaign file.",
        autocompletion=completion.offers(completion.campaign_files),
    ),
]
CampaignName: TypeAlias = Annotated[
    str,
    typer.Argument(
        metavar="CAMPAIGN",
        help="Id or name of a campaign, or its beginning.",
        autocompletion=completion.offers(completion.campaigns),
    ),
]
RunOrTrace: TypeAlias = Annotated[
    str,
    typer.Argument(
        metavar="RUN",
        help="Id of a run, or a trace (.mcap).",
        autocompletion=completion.offers(completion.runs, completion.files(".mcap")),
    ),
]


_TARGET_OPTIONS: Final[dict[str, tuple[Any, Any]]] = {
    "connect": (Connect, ""),
    "state": (State, None),
    "keys": (Keys, None),
}


def as_typed(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command as typer calls it; it writes the answer and returns the exit code.

    A parameter ``target`` becomes ``--connect``, ``--state`` and ``--keys``, and a command that
    answers gets ``--json``, which writes the value. Texts in the annotation of an option are its
    further names and its help.
    """
    signature = inspect.signature(command)
    # Annotations are text (PEP 563), and the type of the answer is not imported at run time.
    annotations = {k: v for k, v in command.__annotations__.items() if k != "return"}
    types = get_type_hints(
        SimpleNamespace(__annotations__=annotations), command.__globals__, include_extras=True
    )
    parameters = [
        one.replace(annotation=_option(name, types[name]), kind=inspect.Parameter.KEYWORD_ONLY)
        for name, one in signature.parameters.items()
        if name != "target"
    ]
    common = dict(_TARGET_OPTIONS) if "target" in signature.parameters else {}
    if "Answer" in str(signature.return_annotation):
        common["as_json"] = (AsJson, False)
    parameters += [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
        for name, (kind, default) in common.items()
    ]

    @functools.wraps(command)
    def typed(**values: Any) -> Any:
        if "connect" in common:
            if keys := values.pop("keys"):
                os.environ["SCENARIO_KEYS"] = str(keys.absolute())
            where = values.pop("connect"), values.pop("state")
            values["target"] = DaemonTarget(*where, say, show_progress)
        as_json = values.pop("as_json", False)
        answer = command(**values)
        if not isinstance(answer, Answer):
            return answer
        if as_json:
            write_json(answer.schema, answer.value)
        else:
            answer.text()
        return int(answer.code)

    typed.__annotations__ = {one.name: one.annotation for one in parameters}
    typed.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=parameters, return_annotation=inspect.Signature.empty
    )
    return typed


def _option(name: str, annotation: Any) -> Any:
    """Return an annotation with the option of its texts, called ``--NAME`` unless they say more."""
    if get_origin(annotation) is not Annotated:
        return annotation
    kind, *notes = get_args(annotation)
    option = notes[-1]
    if isinstance(option, str):
        option = typer.Option(*notes[:-1], help=option)
    # In an annotation, typer keeps the first name as the default value.
    first = () if option.default is ... else (option.default,)
    names = (*first, *(option.param_decls or ()))
    # Without a name, typer would add --no-NAME to a flag.
    if (names or kind is bool) and not any(one.startswith("--") for one in names):
        option.default, option.param_decls = ..., (f"--{name.replace('_', '-')}", *names)
    return Annotated[kind, option]
