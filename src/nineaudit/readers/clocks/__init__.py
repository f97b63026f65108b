"""Clocks: traces of any of them become one recording on one time base."""
