"""MCAP logs: records, damage, and messages of every encoding as columns."""
