"""The index of a campaign, from its tables: one small page (index_rows.py, index_page.py) and JUnit (reporting.py)."""
