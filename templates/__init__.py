"""Artefacts of scenes and campaigns: :mod:`templates.artefacts` lists and makes them."""
