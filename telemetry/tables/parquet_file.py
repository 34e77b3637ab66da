"""Parquet tables."""

from io import BytesIO

import pyarrow as pa
import pyarrow.parquet as pq

from wingwatch.telemetry.tables.numbers import numbers_of
from wingwatch.telemetry.tables.raw_table import RawTable, TableError, first_line, make_table, one_of_each
from wingwatch.telemetry.units import unit_in_brackets

__all__ = ["PARQUET_MAGIC", "read_parquet"]

PARQUET_MAGIC = b"PAR1"


def read_parquet(source: str, data: bytes) -> RawTable:
    """A Parquet table.

    Args:
        source: what sentences call the file.
        data: its bytes.

    Raises:
        TableError: the file is truncated or damaged, or has no rows or no numbers.
    """
    if len(data) < 12 or not data.endswith(PARQUET_MAGIC):
        raise TableError(f"{source}: the Parquet file is truncated: it has no footer; copy it again")
    try:
        table = pq.read_table(BytesIO(data))
    except (pa.ArrowException, OSError, ValueError) as problem:
        raise TableError(f"{source}: the Parquet file is damaged: {first_line(problem)}") from None
    if table.num_rows == 0:
        raise TableError(f"{source}: the Parquet file has no rows")
    found = numbers_of(zip(table.column_names, table.columns, strict=True))
    columns, doubled = one_of_each(found.columns)
    units = {name: unit for name in columns if (unit := unit_in_brackets(name)) is not None}
    return make_table(source, "parquet", columns, found.ignored, found.notes, units, doubled, found.stamps)
