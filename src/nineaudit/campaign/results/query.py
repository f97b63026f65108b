"""SQL over the tables of a lake, by DuckDB: one SELECT, in a memory of its own that sees no file, no network, no
variable of ours, so that a query can be taken from anybody.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from nineaudit.errors import ConfigurationError

if TYPE_CHECKING:
    import duckdb
    import pyarrow as pa

LOCKED: Final = (
    "SET python_enable_replacements = false",
    "SET autoinstall_known_extensions = false",
    "SET autoload_known_extensions = false",
    "SET enable_external_access = false",
    "SET lock_configuration = true",
)
"""Closes the doors of DuckDB, the last one for good."""


def connected(tables: Mapping[str, Any]) -> duckdb.DuckDBPyConnection:
    """A DuckDB whose only views are `tables` (name -> pyarrow dataset or table). ConfigurationError: no DuckDB."""
    connection: duckdb.DuckDBPyConnection = _duckdb().connect(":memory:")
    for name, table in tables.items():
        connection.register(name, table)
    for setting in LOCKED:
        connection.execute(setting)
    return connection


def select(tables: Mapping[str, Any], sql: str) -> pa.Table:
    """What one SELECT gives. ConfigurationError: it is not one, or it cannot be answered."""
    duckdb = _duckdb()
    with connected(tables) as connection:
        try:
            statements = connection.extract_statements(sql)
            if [statement.type for statement in statements] != [duckdb.StatementType.SELECT]:
                raise _refused(sql, statements)
            return connection.sql(sql).to_arrow_table()
        except duckdb.Error as error:
            raise ConfigurationError(_said(error), place="query", advice=_advice(tables, error)) from error


def _refused(sql: str, statements: list[Any]) -> ConfigurationError:
    kinds = ", ".join(statement.type.name for statement in statements) or "nothing"
    return ConfigurationError(
        f"a query is one SELECT, for the tables are made of the results alone; this is {kinds}",
        place="query",
        found=sql if len(sql) < 200 else f"{sql[:200]}...",
    )


def _said(error: Exception) -> str:
    """The first line of what DuckDB says: the rest draws the place with signs."""
    return " ".join(str(error).partition("\n\n")[0].split())


def _advice(tables: Mapping[str, Any], error: Exception) -> str:
    """Where names come from, for a query that has a wrong one."""
    wrong = type(error).__name__ in ("CatalogException", "BinderException")
    return f"the tables are {', '.join(tables)}; DESCRIBE a table shows its columns" if wrong else ""


def _duckdb() -> Any:
    try:
        import duckdb
    except ImportError as error:
        raise ConfigurationError(
            "queries need DuckDB, which is not installed", advice="pip install 'nineaudit[campaign]'"
        ) from error
    return duckdb
