"""The schemes of the source papers, one module a paper: arrays in, arrays out."""
