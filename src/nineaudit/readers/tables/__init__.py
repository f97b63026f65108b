"""Tables: text in any dialect, and Parquet."""
