"""Sections of ROS parameters as lines to compare."""

from dataclasses import fields


def shown(section):
    """Return the kind of a section with its values that are not defaults, and its parts below."""
    values = [(f.name, getattr(section, f.name), f.default) for f in fields(section)]
    own = {name: value for name, value, default in values if value != default}
    parts = [part for name in ("layers", "sources") for part in own.pop(name, ())]
    words = ", ".join(f"{name}={value!r}" for name, value in own.items())
    below = [f"  {line}" for part in parts for line in shown(part)]
    return [f"{type(section).__name__}({words})", *below]


def said(fatal, findings):
    """Return what is said of parameters: errors, warnings, and names without effect."""
    warnings = [
        f"{problem}{' (unread)' if problem.unread else ''}" for problem in findings.problems
    ]
    return [
        *(f"error {problem}" for problem in dict.fromkeys(fatal)),
        *(f"warning {warning}" for warning in dict.fromkeys(warnings)),
        *(f"without effect {finding}" for finding in dict.fromkeys(findings.without_effect)),
    ]
