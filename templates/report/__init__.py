"""Reports as HTML files: templates, style and scripts."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

import jinja2
from markupsafe import Markup

from templates.rendering import strict_environment

OURS: Final = Path(__file__).parent


def render_report(
    filters: Mapping[str, Callable[..., Any]], *, template: str, library: str, **values: Any
) -> str:
    """Return a page filled with ``values``, escaped except for :class:`markupsafe.Markup`.

    Missing names are errors, and invalid characters are replaced. The page executes only
    ``library`` and the scripts of this folder, and it fetches no other resources.
    """
    ours = [file.read_text(encoding="utf-8") for file in sorted(OURS.glob("*.js"))]
    script = "\n".join((library, *ours))
    digest = b64encode(sha256(script.encode()).digest()).decode()
    allowed = f"script-src 'sha256-{digest}'; style-src 'unsafe-inline'; img-src data:"
    environment = strict_environment(jinja2.FileSystemLoader(OURS), autoescape=True)
    environment.filters.update(filters)
    page = environment.get_template(template)
    return page.render(
        values, script=Markup(script), policy=Markup(f"default-src 'none'; {allowed}")
    )
