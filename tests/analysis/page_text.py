"""A page of ours as text: what a reader sees of it, line by line."""

import re

import html5lib

from daemon.model.spec import own_version

LINES = {"h1", "h2", "h3", "p", "li", "dt", "dd", "figcaption", "summary", "caption", "pre"}


def without_scripts(page):
    """What a reader whose browser executes nothing is sent."""
    return re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def parse(page):
    """The page as a browser would understand it; anything not well formed raises."""
    return html5lib.HTMLParser(strict=True).parse(without_scripts(page))


def words(element):
    return " ".join(" ".join(element.itertext()).split())


def lines_of(element):
    """What a reader sees, line by line; a picture by its name."""
    tag = str(element.tag).rpartition("}")[2]
    if tag in ("head", "style"):
        return
    if tag == "svg" or element.get("role") == "img":
        yield f"[{element.get('aria-label')}]"
    elif tag == "tr":
        yield " | ".join(map(words, element))
    elif tag in LINES:
        yield words(element)
    else:
        yield (element.text or "").strip()
        for child in element:
            yield from lines_of(child)
            yield (child.tail or "").strip()


def text_of(page):
    text = "\n".join(filter(None, lines_of(parse(page))))
    return text.replace(own_version(), "VERSION") + "\n"
