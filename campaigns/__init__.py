"""Campaigns and layers that ship with the project: data only, found through importlib.resources."""
