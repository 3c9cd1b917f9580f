"""Studies: how the tables and pictures of the documentation were made, to make them again."""
