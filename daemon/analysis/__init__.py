"""What recorded runs tell: judged again, reported, their coverage, the causes of failures."""
