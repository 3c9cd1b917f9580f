"""Analysis of recorded runs: new judgements, reports, coverage, causes of failures."""
