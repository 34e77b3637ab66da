"""Table readers: files known by their first bytes, as named columns of numbers."""

from pathlib import Path

from wingwatch.telemetry.recording.reading import is_recording
from wingwatch.telemetry.recording.recorded_flight import read_recording
from wingwatch.telemetry.tables.csv_file import is_text, read_csv
from wingwatch.telemetry.tables.hdf5_file import read_hdf5
from wingwatch.telemetry.tables.matlab_file import MATLAB_5_MAGIC, read_matlab
from wingwatch.telemetry.tables.parquet_file import PARQUET_MAGIC, read_parquet
from wingwatch.telemetry.tables.raw_table import RawTable, TableError

__all__ = ["RawTable", "TableError", "read_table"]

_HDF5_MAGICS = (b"\x89HDF", b"MATLAB 7.3")
_FORMATS = "CSV, Parquet, MATLAB .mat (version 5 to 7.3) and MCAP"
_MARKS = b"\xef\xbb\xbf\xff\xfe \t\r\n\0"


def read_table(path: Path) -> RawTable:
    """Every numeric column of a file.

    Raises:
        TableError: the file is missing, unreadable, empty, truncated, damaged or of no known format.
        RecordingError: a recording that cannot be read, or holds several vehicles.
    """
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise TableError(f"{path}: there is no such file; check the path") from None
    except OSError as problem:
        raise TableError(f"{path}: cannot be read: {problem.strerror}") from None
    if not data.strip():
        raise TableError(f"{path}: the file is empty; give one with samples")
    if data.startswith(PARQUET_MAGIC):
        return read_parquet(str(path), data)
    if data.startswith(MATLAB_5_MAGIC):
        return read_matlab(str(path), data)
    if data.startswith(_HDF5_MAGICS):
        return read_hdf5(str(path), data)
    if is_recording(data[:64]):
        return read_recording(path)
    if not is_text(data):
        raise TableError(f"{path}: the format is not known; {_FORMATS} can be read")
    if not data.strip(_MARKS):
        raise TableError(f"{path}: the file is empty; give one with samples")
    return read_csv(str(path), data)
