"""ISO-MME (ISO/TS 13499): the tests of the crash field."""
