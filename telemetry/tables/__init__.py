"""Tables in files, one format a module, as named columns of numbers."""

from wingwatch.telemetry.tables.raw_table import RawTable, TableError

__all__ = ["RawTable", "TableError"]
