"""Studies whose tables stand in the documentation: how each table was made, to make it again."""
