"""What a lake says: its entries as tables (schema.py, rows.py, compact.py, tables.py), asked (query.py, answers.py,
stale.py) and compared (diff.py)."""
