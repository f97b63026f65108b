"""A campaign: thousands of recordings on Dask, and what they say together.

Reading order: sources.py (which recordings), task.py (the audit of one, as any engine may call it), lake.py (where
results are kept), child.py and guard.py (an audit in a process of its own), running.py and clusters.py (many, on Dask),
results/ (the lake as tables, asked and compared), health/ (what all tests say of each sensor), index/ (the page).
"""

from __future__ import annotations
