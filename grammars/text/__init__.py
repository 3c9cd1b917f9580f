"""Reading text: YAML with places, quantities with units, messages for people, JSON, syntax trees.

Every language and file format reads by way of these modules. None of them knows what a scene is.
"""
