"""Campaigns and layers that ship with the project: data for importlib.resources, and studies."""
