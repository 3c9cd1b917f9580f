"""Jinja templates of the artefacts: ours, and those of people who put their own before them."""

from __future__ import annotations

import json
import math
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import jinja2

from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where, did_you_mean
from templates.naming import xml_text

BUILT_IN: Final = Path(__file__).parent / "files"
# Endings of templates into which everything is put escaped.
_XML: Final = (".sdf.j2", ".world.j2", ".config.j2", ".svg.j2", ".launch.j2", ".xml.j2")


class Templates:
    """The templates in force: a file in ``folder`` replaces ours of the same name.

    Names that are missing in a template are errors, and everything put into XML is escaped.
    """

    def __init__(self, folder: Path | None = None) -> None:
        loaders = [jinja2.FileSystemLoader(BUILT_IN)]
        if folder is not None:
            loaders.insert(0, jinja2.FileSystemLoader(folder))
        self.folder = folder
        self._environment = strict_environment(
            jinja2.ChoiceLoader(loaders),
            autoescape=lambda name: bool(name and name.endswith(_XML)),
            keep_trailing_newline=True,
        )
        self._environment.filters.update(number=number, numbers=numbers, json=_json)

    def render(self, template: str, /, **values: Any) -> str:
        """Return ``template`` filled with ``values``.

        Raises :class:`InputError` with file and line when a template cannot be used.
        """
        try:
            return self._environment.get_template(template).render(values)
        except jinja2.TemplateSyntaxError as error:
            where = Where(error.filename or template, error.lineno)
            raise InputError.at(where, f"not a template: {error.message}") from error
        except Exception as error:
            # Whatever a template of somebody else does, its author is who can mend it.
            if self.folder is None:
                raise
            where = _place(error, self.folder, template)
            message = f"the template cannot be filled: {type(error).__name__}: {error}"
            raise InputError.at(where, message, f"it is given {_known(values)}") from error

    def unused(self) -> tuple[Diagnostic, ...]:
        """Return a warning for each template in the folder that replaces none of ours."""
        if self.folder is None:
            return ()
        ours = [path.name for path in BUILT_IN.glob("*.j2")]
        return tuple(
            Diagnostic(
                Where(str(path)),
                "this template replaces none of ours; it is used only where another includes it",
                did_you_mean(path.name, ours),
                Severity.WARNING,
            )
            for path in sorted(self.folder.glob("*.j2"))
            if path.name not in ours
        )


def strict_environment(loader: jinja2.BaseLoader, **options: Any) -> jinja2.Environment:
    """Return an environment in which missing names are errors and texts are fit for XML."""
    return jinja2.Environment(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        # Plain strings only: what is marked as safe was made here and stays as it is.
        finalize=lambda value: xml_text(value) if type(value) is str else value,
        trim_blocks=True,
        lstrip_blocks=True,
        **options,
    )


def number(value: float, digits: int = 9) -> str:
    """Return ``value`` in plain decimals, rounded to ``digits``; no exponent, no ``-0``.

    Raises :class:`ValueError` for what is not finite: no file format here can hold it.
    """
    if not math.isfinite(value):
        raise ValueError(f"{value} is no number a file can hold")
    text = f"{value:.{digits}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text == "-0" else text


def numbers(values: Any, digits: int = 9) -> str:
    """Return numbers separated by blanks."""
    return " ".join(number(value, digits) for value in values)


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _known(values: dict[str, Any]) -> str:
    return ", ".join(sorted(values)) or "no values"


def _place(error: Exception, folder: Path, name: str) -> Where:
    frames: list[traceback.FrameSummary] = traceback.extract_tb(error.__traceback__)
    inside: Callable[[str], bool] = lambda file: Path(file).suffix == ".j2"  # noqa: E731
    found = [frame for frame in frames if inside(frame.filename)]
    if found:
        return Where(found[-1].filename, found[-1].lineno or 0)
    return Where(str(folder / name))
