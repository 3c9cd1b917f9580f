"""Command line and terminal dashboard."""
