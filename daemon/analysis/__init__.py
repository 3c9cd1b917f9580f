"""Analysis of recorded runs: judged again, reported, their coverage, the causes of failures."""
