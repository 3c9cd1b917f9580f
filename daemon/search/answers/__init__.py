"""What a search has found: values, findings, sentences, and the files it leaves."""
