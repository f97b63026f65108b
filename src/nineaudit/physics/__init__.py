"""The equations: arrays in, arrays out; no files and no values of ours."""
