from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from wingwatch.telemetry import TableError, read_table


def write(path: Path, data: str | bytes) -> Path:
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


class TestCsv:
    @pytest.mark.parametrize("delimiter", [",", ";", "\t", "|"])
    @pytest.mark.parametrize("line_end", ["\n", "\r\n"])
    def test_columns_are_read_whatever_the_delimiter(
        self, tmp_path: Path, delimiter: str, line_end: str
    ) -> None:
        rows = [["time_s", "q"], ["0.1", "-1e-3"], ["0.2", ""], ["0.3", "nan"]]
        text = line_end.join(delimiter.join(row) for row in rows) + line_end
        table = read_table(write(tmp_path / "flight.txt", text))
        assert table.format == "csv"
        assert table.columns["time_s"].tolist() == [0.1, 0.2, 0.3]
        np.testing.assert_array_equal(table.columns["q"], [-1e-3, np.nan, np.nan])
        assert table.notes == ()

    def test_a_byte_order_mark_quotes_and_latin_text_do_no_harm(self, tmp_path: Path) -> None:
        marked = read_table(write(tmp_path / "a.csv", b'\xef\xbb\xbf"time_s","q"\n1,2\n'))
        assert list(marked.columns) == ["time_s", "q"]
        latin = read_table(write(tmp_path / "b.csv", b"time_s,temp \xb0C\n1,2\n"))
        assert list(latin.columns) == ["time_s", "temp °C"]

    def test_short_rows_are_left_out_and_counted(self, tmp_path: Path) -> None:
        table = read_table(write(tmp_path / "a.csv", "time_s,q,r\n1,2,3\n2,3\n3,4,5\n4,5"))
        assert table.columns["time_s"].tolist() == [1.0, 3.0]
        assert "2 rows left out because they do not have 3 fields" in table.notes
        assert any("cut short" in note for note in table.notes)

    def test_garbage_in_a_column_of_numbers_is_a_missing_value_and_is_said(self, tmp_path: Path) -> None:
        table = read_table(write(tmp_path / "a.csv", "time_s,q,name\n1,2,x\n2,#?!,y\n3,4,z\n"))
        np.testing.assert_array_equal(table.columns["q"], [2.0, np.nan, 4.0])
        assert table.notes == ("cells that hold no number: q 1",)
        assert table.ignored == ("name (text)",)

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("", "empty"),
            (" \n\n", "empty"),
            ("time_s,q\n", "no rows"),
            ("hello world\n", "no table"),
            ("time_s,q\n1,2,3\n2,3,4\n", "names 2 columns and the rows have 3 fields"),
            ("t;q\n", "no rows"),
            ("time_s,q\na,b\n", "no column holds numbers"),
            (b"\x00\x01\x02", "format is not known"),
        ],
    )
    def test_what_is_no_table_is_said_in_one_sentence(
        self, tmp_path: Path, text: str | bytes, said: str
    ) -> None:
        with pytest.raises(TableError) as caught:
            read_table(write(tmp_path / "flight.csv", text))
        assert said in str(caught.value)
        assert "flight.csv" in str(caught.value)
        assert "\n" not in str(caught.value)


class TestParquet:
    def test_numbers_flags_and_missing_values_are_read_by_content_not_by_name(self, tmp_path: Path) -> None:
        path = tmp_path / "flight.csv"
        columns = {
            "time_s": [1.0, 2.0],
            "n": pa.array([1, None], pa.int32()),
            "on": [True, False],
            "s": ["x", "y"],
        }
        pq.write_table(pa.table(columns), path)
        table = read_table(path)
        assert table.format == "parquet"
        np.testing.assert_array_equal(table.columns["n"], [1.0, np.nan])
        np.testing.assert_array_equal(table.columns["on"], [1.0, 0.0])
        assert table.ignored == ("s (text)",)

    def test_a_truncated_or_damaged_file_is_said(self, tmp_path: Path) -> None:
        path = tmp_path / "flight.parquet"
        pq.write_table(pa.table({"time_s": np.arange(1000.0)}), path)
        whole = path.read_bytes()
        for length in (4, 100, len(whole) // 2, len(whole) - 1):
            with pytest.raises(TableError, match="truncated"):
                read_table(write(path, whole[:length]))
        with pytest.raises(TableError, match="damaged"):
            read_table(write(path, whole[:200] + b"\xff" * (len(whole) - 208) + whole[-8:]))

    def test_a_table_without_rows_is_said(self, tmp_path: Path) -> None:
        path = tmp_path / "flight.parquet"
        pq.write_table(pa.table({"time_s": np.empty(0)}), path)
        with pytest.raises(TableError, match="no rows"):
            read_table(path)


class TestMatlab:
    def test_a_struct_of_vectors_is_a_table_and_the_rest_is_listed(self, tmp_path: Path) -> None:
        path = tmp_path / "log.dat"
        flight = {
            "time": np.arange(5.0)[:, None],
            "q": np.arange(5.0)[None, :],
            "mode": np.arange(5, dtype=np.uint8)[:, None],
            "slow": np.arange(3.0),
            "mass": 2.5,
            "name": "thor",
            "matrix": np.ones((5, 2)),
        }
        scipy.io.savemat(path, {"flight_data": flight, "info": {"number": 7.0}})
        table = read_table(path)
        assert table.format == "matlab"
        assert sorted(table.columns) == ["matrix[0]", "matrix[1]", "mode", "q", "time"]
        assert table.columns["mode"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
        assert sorted(table.ignored) == [
            "mass (scalar)",
            "name (no numbers)",
            "number (scalar)",
            "slow (3 values)",
        ]

    def test_fields_of_one_name_in_two_structs_keep_the_structs_name(self, tmp_path: Path) -> None:
        path = tmp_path / "log.mat"
        scipy.io.savemat(path, {"imu": {"q": np.arange(4.0)}, "nav": {"q": -np.arange(4.0), "h": np.ones(4)}})
        assert sorted(read_table(path).columns) == ["h", "imu.q", "nav.q"]

    def test_truncated_at_any_place_it_is_said(self, tmp_path: Path) -> None:
        path = tmp_path / "log.mat"
        values = {name: np.random.default_rng(1).normal(size=500) for name in ("time", "q")}
        scipy.io.savemat(path, {"flight": values}, do_compression=True)
        whole = path.read_bytes()
        for length in (20, 128, 140, len(whole) // 2, len(whole) - 1):
            with pytest.raises(TableError, match=r"log.mat: the MATLAB file (is truncated|holds no vector)"):
                read_table(write(path, whole[:length]))


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"none.csv: there is no such file"):
        read_table(tmp_path / "none.csv")
    with pytest.raises(TableError, match="cannot be read"):
        read_table(tmp_path)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150)
@given(
    st.sampled_from([b"", b"PAR1", b"MATLAB 5.0 MAT-file" + b" " * 105 + b"\x00\x01IM", b"time_s,q\n1,2\n"]),
    st.binary(max_size=300),
)
@example(b"", b"\x85")
def test_any_bytes_are_a_table_or_one_sentence(tmp_path: Path, start: bytes, rest: bytes) -> None:
    with suppress(TableError):
        assert len(read_table(write(tmp_path / "flight", start + rest))) > 0
