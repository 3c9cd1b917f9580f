"""Batch: campaigns executed by a daemon and its workers, kept in a ledger."""
