"""Artefacts made from scenes and campaigns: :mod:`templates.artefacts` lists and makes them."""
