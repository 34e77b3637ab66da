"""Text, Parquet and MATLAB tables as people bring them: each kind in several forms, and the ordinary one among them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from telemetry_flights import flight_columns
from test_telemetry_flight import write_columns

from wingwatch.telemetry import (
    FlightError,
    FlightTable,
    MapError,
    TableError,
    load_flight,
    parse_map,
    read_table,
)

NAMES = ("time_s", "q", "r")
ROWS = [[0.5, -1.25, 1000.0], [0.75, 2.5, 1001.0], [1.0, 0.125, 1002.5]]


def text_of(rows: list[list[float]], delimiter: str = ",", decimal: str = ".") -> list[str]:
    return [delimiter.join(f"{value:g}".replace(".", decimal) for value in row) for row in rows]


def write(path: Path, data: str | bytes) -> Path:
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def rows_of(path: Path, names: tuple[str, ...] = NAMES) -> list[list[float]]:
    table = read_table(path)
    rows: list[list[float]] = np.column_stack([table.columns[name] for name in names]).tolist()
    return rows


@pytest.mark.parametrize(
    "above",
    [
        "",
        "\n\n",
        "# logged by X, at, noon\n# second remark\n",
        "Flight recorder 5\nFirmware;1.2;beta\n\n",
        '"Product","Recorder of flights"\n"Firmware","4"\n',
        "// remark\n\n% another, with, commas\n",
    ],
)
@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|"])
def test_the_header_is_found_below_what_stands_above_it(tmp_path: Path, above: str, delimiter: str) -> None:
    lines = [delimiter.join(NAMES), *text_of(ROWS, delimiter)]
    assert rows_of(write(tmp_path / "a.csv", above + "\n".join(lines) + "\n")) == ROWS


@pytest.mark.parametrize("mark", ["#", "# ", "% ", "//"])
@pytest.mark.parametrize("delimiter", [",", " ", "\t"])
def test_a_header_may_be_a_comment(tmp_path: Path, mark: str, delimiter: str) -> None:
    lines = ["# made by hand", mark + delimiter.join(NAMES), *text_of(ROWS, delimiter)]
    assert rows_of(write(tmp_path / "a.txt", "\n".join(lines) + "\n")) == ROWS


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\r\r\n"])
def test_any_line_end_is_one(tmp_path: Path, end: str) -> None:
    assert rows_of(write(tmp_path / "a.csv", end.join([",".join(NAMES), *text_of(ROWS), ""]))) == ROWS


def test_line_ends_may_differ_within_a_file(tmp_path: Path) -> None:
    a, b, c = text_of(ROWS)
    assert rows_of(write(tmp_path / "a.csv", f"{','.join(NAMES)}\r\n{a}\r{b}\n{c}\r\r\n")) == ROWS


@pytest.mark.parametrize(
    ("header", "rows"), [("", ","), (",", ""), (",", ","), ("", ",,,"), (",,", ","), ("", " , ")]
)
def test_delimiters_too_many_at_line_ends_are_no_columns(tmp_path: Path, header: str, rows: str) -> None:
    lines = [",".join(NAMES) + header, *(row + rows for row in text_of(ROWS))]
    assert rows_of(write(tmp_path / "a.csv", "\n".join(lines) + "\n")) == ROWS
    assert read_table(tmp_path / "a.csv").notes == ()


def test_an_empty_last_cell_is_a_missing_value_beside_rows_with_a_comma_too_many(tmp_path: Path) -> None:
    table = read_table(write(tmp_path / "a.csv", "t,q,r\n1,2,3\n2,3,\n3,4,5,\n"))
    np.testing.assert_array_equal(table.columns["r"], [3.0, np.nan, 5.0])


@pytest.mark.parametrize("delimiter", [";", "\t", "|", "   "])
def test_decimal_commas_are_numbers(tmp_path: Path, delimiter: str) -> None:
    lines = [delimiter.join(NAMES), *text_of(ROWS, delimiter, ",")]
    assert rows_of(write(tmp_path / "a.csv", "\n".join(lines) + "\n")) == ROWS


def test_columns_of_whole_numbers_beside_decimal_commas_stay_what_they_are(tmp_path: Path) -> None:
    text = "t;whole;rare;large\n0,5;3;1;1.234,5\n1,5;4;2;12.345,25\n2,5;5;2,5;1.234.567,75\n"
    columns = read_table(write(tmp_path / "a.csv", text)).columns
    assert columns["whole"].tolist() == [3.0, 4.0, 5.0]
    assert columns["rare"].tolist() == [1.0, 2.0, 2.5]
    assert columns["large"].tolist() == [1234.5, 12345.25, 1234567.75]


def test_thousands_of_an_english_table_are_no_decimals(tmp_path: Path) -> None:
    table = read_table(write(tmp_path / "a.csv", "t;h\n0.5;1,250\n1.0;12,750\n1.5;900\n"))
    assert table.columns["h"].tolist() == [1250.0, 12750.0, 900.0]
    assert table.notes == ("commas in h are taken for those of thousands",)


def test_decimal_commas_between_commas_are_named(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "time_s,q\n0,5,1,5\n0,6,1,7\n0,7,1,9\n")
    with pytest.raises(TableError, match="decimal commas the columns must be parted by semicolons"):
        read_table(path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
def test_any_encoding_of_a_table_is_read(tmp_path: Path, encoding: str) -> None:
    lines = [",".join(NAMES) + ",température °", *(row + ",1" for row in text_of(ROWS))]
    assert rows_of(write(tmp_path / "a.csv", ("\r\n".join(lines) + "\r\n").encode(encoding))) == ROWS


@pytest.mark.parametrize("blanks", [" ", "   ", "\t\t", " \t "])
def test_without_a_header_columns_have_numbers(tmp_path: Path, blanks: str) -> None:
    text = "\n".join("  " + row for row in text_of(ROWS, blanks)) + "\n"
    path = write(tmp_path / "a.asc", text)
    assert rows_of(path, ("1", "2", "3")) == ROWS
    assert "no line names the columns: they are called 1 to 3" in read_table(path).notes


def test_fortran_exponents_are_numbers(tmp_path: Path) -> None:
    path = write(
        tmp_path / "a.asc", " 0.5D+00 -1.25D+00 1.0D+03\n 0.75D+00 2.5D+00 1.001D+03\n 1.D0 .125D0 1.0025D3\n"
    )
    assert rows_of(path, ("1", "2", "3")) == ROWS


@pytest.mark.parametrize(
    "text",
    [
        "t,q,phi\ns,deg/s,°\n0,1,2\n1,2,3\n",
        "t,q,phi\n[s],[deg/s],[deg]\n0,1,2\n1,2,3\n",
        "#s, dps, degrees\nt,q,phi\n0,1,2\n1,2,3\n",
        "t [s];q (deg/s);phi [°]\n0;1;2\n1;2;3\n",
    ],
)
def test_units_of_the_file_are_known(tmp_path: Path, text: str) -> None:
    table = read_table(write(tmp_path / "a.csv", text))
    assert len(table) == 2
    assert len(table.units) == 3


def test_a_row_that_is_neither_names_nor_units_is_named(tmp_path: Path) -> None:
    text = "t,q,r\ns,deg/s,deg/s\nSmp,Avg,Avg\n0,1,2\n1,2,3\n"
    assert any(
        "line 3 holds no numbers" in note for note in read_table(write(tmp_path / "a.csv", text)).notes
    )


def test_loggers_of_the_field_are_read(tmp_path: Path) -> None:
    toa5 = (
        '"TOA5","CR6","CR6","123","CR6.Std","CPU:x","1","t"\n"TIMESTAMP","RECORD","p","q"\n"TS","RN","deg/s","rad/s"\n'
        '"","","Avg","Smp"\n"2020-01-01 10:00:00.02",0,1.5,2.5\n"2020-01-01 10:00:00.04",1,1.6,2.6\n'
    )
    table = read_table(write(tmp_path / "toa5.csv", toa5))
    assert table.columns["p"].tolist() == [1.5, 1.6]
    assert (table.units["p"], table.units["q"]) == ("deg/s", "rad/s")
    np.testing.assert_allclose(table.columns["TIMESTAMP"], [0.0, 0.02])
    cockpit = (
        '#airframe_info, log_version="1.00", airframe_name="X"\n#yyy-mm-dd, hh:mm:ss, hh:mm, ident, degrees, kt, g\n'
        "  Lcl Date, Lcl Time, UTCOfst, AtvWpt, Latitude, TAS, NormAc\n"
        "2020-01-01, 10:00:00,  -07:00,  ABC,  40.5, 100.5, 0.02\n"
        "2020-01-01, 10:00:01,  -07:00,  ABC,  40.6, 100.6, 0.03\n"
    )
    table = read_table(write(tmp_path / "cockpit.csv", cockpit))
    assert table.columns["TAS"].tolist() == [100.5, 100.6]
    assert (table.units["Latitude"], table.units["TAS"], table.units["NormAc"]) == ("degrees", "kt", "g")
    with pytest.raises(FlightError, match=r"time_s = \{ source = \"'Lcl Date' \+ 'Lcl Time'\" \}"):
        load_flight(tmp_path / "cockpit.csv")


def test_unlike_columns_of_one_name_are_refused_where_they_are_used(tmp_path: Path) -> None:
    write_columns(tmp_path / "a.csv", flight_columns(20))
    head, *rows = (tmp_path / "a.csv").read_text().splitlines()
    lines = [f"{head},x,x,y,y", *(f"{row},{k},{k + 1},7,7" for k, row in enumerate(rows))]
    path = write(tmp_path / "b.csv", "\n".join(lines) + "\n")
    assert len(load_flight(path).block) == 20
    good = parse_map('format = 1\n[channels]\nthrottle = { source = "y / 10" }')
    assert load_flight(path, good).block.column("throttle").tolist() == [0.7] * 20
    bad = parse_map('format = 1\n[channels]\nthrottle = { source = "x / 100" }')
    with pytest.raises(MapError, match="several columns 'x'"):
        load_flight(path, bad)
    twice = write(
        tmp_path / "c.csv", "\n".join([f"{head},roll_rad", *(f"{row},{k}" for k, row in enumerate(rows))])
    )
    with pytest.raises(MapError, match="several columns 'roll_rad'"):
        load_flight(twice)


def degrees(columns: dict[str, Any], unit: str) -> dict[str, Any]:
    factor = {"deg/s": 180.0 / np.pi, "rad/s": 1.0}[unit]
    return {**columns, "roll_rate_rad_s": columns["roll_rate_rad_s"] * factor}


class TestUnits:
    """Units that a file states: taken where the map says none, and never passed over."""

    def load(self, path: Path, columns: dict[str, Any], unit: str, entry: str = "") -> FlightTable:
        others = {k: v for k, v in columns.items() if k != "roll_rate_rad_s"}
        names = [*others, "p"]
        table = np.column_stack([*others.values(), columns["roll_rate_rad_s"]])
        rows = "\n".join(",".join(map(repr, row)) for row in table.tolist())
        units = ",".join(["-"] * len(others) + [unit])
        rules = parse_map(f'format = 1\n[channels]\nroll_rate_rad_s = {{ source = "p"{entry} }}')
        return load_flight(write(path / "a.csv", f"{','.join(names)}\n{units}\n{rows}\n"), rules)

    @pytest.mark.parametrize("written", ["deg/s", "°/s", "[dps]", "(deg/sec)", "Deg/s"])
    def test_degrees_are_converted_and_said(self, tmp_path: Path, written: str) -> None:
        columns = flight_columns(30)
        found = self.load(tmp_path, degrees(columns, "deg/s"), written)
        np.testing.assert_allclose(found.block.column("roll_rate_rad_s"), columns["roll_rate_rad_s"])
        assert any("p from deg/s" in note for note in found.report.notes)

    def test_the_map_s_own_unit_and_factor_go_before(self, tmp_path: Path) -> None:
        columns = flight_columns(30)
        for entry in (', unit = "deg/s"', ", scale = 0.0174532925"):
            found = self.load(tmp_path, degrees(columns, "deg/s"), "deg/s", entry)
            np.testing.assert_allclose(found.block.column("roll_rate_rad_s"), columns["roll_rate_rad_s"])

    def test_si_and_dashes_change_nothing(self, tmp_path: Path) -> None:
        columns = flight_columns(30)
        for written in ("rad/s", "-", ""):
            found = self.load(tmp_path, columns, written)
            np.testing.assert_array_equal(found.block.column("roll_rate_rad_s"), columns["roll_rate_rad_s"])

    def test_a_unit_of_another_kind_is_refused_and_an_unknown_one_is_said(self, tmp_path: Path) -> None:
        with pytest.raises(MapError, match="the file has p in m/s"):
            self.load(tmp_path, flight_columns(30), "m/s")
        notes = self.load(tmp_path, flight_columns(30), "counts").report.notes
        assert any("'counts' of p is not known: roll_rate_rad_s takes it as rad/s" in note for note in notes)


STAMPS: dict[str, Callable[[int], str]] = {
    "zulu": lambda k: f"2026-03-04T10:30:{25 + k // 50:02d}.{20 * (k % 50):03d}Z",
    "zone": lambda k: f"2026-03-04T12:30:{25 + k // 50:02d}.{20 * (k % 50):03d}+02:00",
    "blank": lambda k: f"2026-03-04 10:30:{25 + k // 50:02d}.{20 * (k % 50):03d}",
    "german": lambda k: f"04.03.2026 10:30:{25 + k // 50:02d}.{20 * (k % 50):03d}",
    "american": lambda k: f"03/04/2026 10:30:{25 + k // 50:02d}.{20 * (k % 50):03d} AM",
    "day": lambda k: f"10:30:{25 + k // 50:02d}.{20 * (k % 50):03d}",
    "minutes": lambda k: f"30:{25 + k // 50:02d}.{20 * (k % 50):03d}",
}


@pytest.mark.parametrize("form", sorted(STAMPS))
def test_a_date_or_a_time_of_day_is_the_flight_s_time(tmp_path: Path, form: str) -> None:
    columns = flight_columns(120)
    del columns["time_s"]
    stamps = [STAMPS[form](k) for k in range(120)]
    rows = [
        ",".join([s, *map(repr, row)])
        for s, row in zip(stamps, np.column_stack([*columns.values()]).tolist(), strict=True)
    ]
    path = write(tmp_path / "a.csv", "\n".join([",".join(["when", *columns]), *rows]) + "\n")
    flight = load_flight(path, parse_map('format = 1\n[channels]\ntime_s = { source = "when" }'))
    time_s = flight.block.time_s
    np.testing.assert_allclose(time_s - time_s[0], 0.02 * np.arange(120), atol=1e-9)
    with pytest.raises(MapError, match="leave its unit out"):
        load_flight(path, parse_map('format = 1\n[channels]\ntime_s = { source = "when", unit = "ms" }'))


@pytest.mark.parametrize(
    "dates", [("04.03.2026", "05.03.2026"), ("3/4/2026", "3/5/2026"), ("2026-02-28", "2026-03-01")]
)
def test_date_and_time_apart_add_up_over_midnight(tmp_path: Path, dates: tuple[str, str]) -> None:
    rows = [f"{dates[0]};23:59:59.{k}" for k in range(10)] + [f"{dates[1]};00:00:00.{k}" for k in range(10)]
    path = write(tmp_path / "a.csv", "\n".join(["date;clock", *rows]) + "\n")
    table = read_table(path)
    time_s = table.columns["date"] + table.columns["clock"]
    np.testing.assert_allclose(np.diff(time_s), 0.1, atol=1e-6)
    assert set(table.stamps) == {"date", "clock"}


@pytest.mark.parametrize(
    "kind",
    [
        pa.timestamp("ms"),
        pa.timestamp("us", "UTC"),
        pa.timestamp("ns"),
        pa.duration("us"),
        pa.duration("ns"),
        pa.time64("us"),
    ],
    ids=str,
)
def test_parquet_s_own_times_are_seconds(tmp_path: Path, kind: Any) -> None:
    begin = 0 if not pa.types.is_timestamp(kind) else 1_772_620_225_000_000
    ticks = pa.array(begin + 20_000 * np.arange(40), pa.int64()).cast(
        pa.timestamp("us") if begin else pa.duration("us")
    )
    column = (
        pa.array(20_000 * np.arange(40), pa.int64()).cast(kind)
        if pa.types.is_time(kind)
        else ticks.cast(kind)
    )
    columns = flight_columns(40)
    del columns["time_s"]
    pq.write_table(pa.table({"timestamp": column, **columns}), tmp_path / "a.parquet")
    flight = load_flight(
        tmp_path / "a.parquet", parse_map('format = 1\n[channels]\ntime_s = { source = "timestamp" }')
    )
    np.testing.assert_allclose(flight.block.time_s - flight.block.time_s[0], 0.02 * np.arange(40), atol=1e-9)


def test_parquet_s_vectors_are_columns(tmp_path: Path) -> None:
    matrix = np.arange(12.0).reshape(4, 3)
    pq.write_table(pa.table({"gyro": pa.array(matrix.tolist()), "t": np.arange(4.0)}), tmp_path / "a.parquet")
    assert read_table(tmp_path / "a.parquet").columns["gyro[2]"].tolist() == matrix[:, 2].tolist()


class TestMatlab:
    matrix = np.random.default_rng(5).normal(size=(60, 4))

    @pytest.mark.parametrize("turned", [False, True])
    def test_a_matrix_is_columns_from_0(self, tmp_path: Path, turned: bool) -> None:
        scipy.io.savemat(tmp_path / "a.mat", {"fdata": self.matrix.T if turned else self.matrix, "mass": 3.0})
        columns = read_table(tmp_path / "a.mat").columns
        assert sorted(columns) == [f"fdata[{k}]" for k in range(4)]
        np.testing.assert_array_equal(columns["fdata[3]"], self.matrix[:, 3])

    @pytest.mark.parametrize("shape", [(60, 3), (3, 60), (3, 1, 60), (1, 3, 60)])
    def test_fields_of_three_columns_are_three(self, tmp_path: Path, shape: tuple[int, ...]) -> None:
        three = self.matrix[:, :3]
        gyro = three if shape == (60, 3) else three.T.reshape(shape)
        scipy.io.savemat(tmp_path / "a.mat", {"log": {"t": np.arange(60.0), "imu": {"gyro": gyro}}})
        columns = read_table(tmp_path / "a.mat").columns
        np.testing.assert_array_equal(columns["gyro[1]"], three[:, 1])
        assert columns["t"].size == 60

    def test_a_list_of_names_names_the_columns_too(self, tmp_path: Path) -> None:
        names = np.array(["t", "p", "q", "r"], dtype=object)
        scipy.io.savemat(tmp_path / "a.mat", {"fdata": self.matrix, "labels": names})
        table = read_table(tmp_path / "a.mat")
        np.testing.assert_array_equal(table.columns["q"], table.columns["fdata[2]"])
        assert "columns of fdata have the names that labels lists" in table.notes

    def test_an_array_of_structs_is_rows_or_parts(self, tmp_path: Path) -> None:
        rows = np.zeros((1, 60), dtype=[("t", object), ("gyro", object)])
        parts = np.zeros((1, 2), dtype=[("gyro", object)])
        for k in range(60):
            rows[0, k] = (np.array([[0.1 * k]]), self.matrix[k : k + 1, :3])
        for k in range(2):
            parts[0, k] = (self.matrix[:, k : k + 1],)
        scipy.io.savemat(tmp_path / "a.mat", {"log": rows})
        columns = read_table(tmp_path / "a.mat").columns
        np.testing.assert_allclose(columns["t"], 0.1 * np.arange(60))
        np.testing.assert_array_equal(columns["gyro[2]"], self.matrix[:, 2])
        scipy.io.savemat(tmp_path / "b.mat", {"imu": parts})
        np.testing.assert_array_equal(
            read_table(tmp_path / "b.mat").columns["imu[1].gyro"], self.matrix[:, 1]
        )

    def test_small_matrices_and_vectors_do_not_say_how_many_rows_there_are(self, tmp_path: Path) -> None:
        log = {"t": np.arange(600.0), "q": np.arange(600.0), "calibration": np.eye(12)}
        scipy.io.savemat(tmp_path / "a.mat", {"log": log})
        assert sorted(read_table(tmp_path / "a.mat").columns) == ["q", "t"]
        parts = {name: np.ones(3) for name in ("inertia", "place", "cg", "axis")}
        scipy.io.savemat(tmp_path / "b.mat", {"fdata": self.matrix, **parts})
        assert sorted(read_table(tmp_path / "b.mat").columns) == [f"fdata[{k}]" for k in range(4)]

    def test_a_flight_is_read_from_a_matrix_by_a_map(self, tmp_path: Path) -> None:
        columns = flight_columns(50)
        scipy.io.savemat(tmp_path / "a.mat", {"fdata": np.column_stack([*columns.values()])})
        entries = "\n".join(f'{name} = {{ source = "fdata[{k}]" }}' for k, name in enumerate(columns))
        flight = load_flight(tmp_path / "a.mat", parse_map(f"format = 1\n[channels]\n{entries}"))
        np.testing.assert_array_equal(flight.block.column("pitch_rad"), columns["pitch_rad"])


def test_columns_of_a_file_without_names_are_counted_in_the_refusal(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "a.asc", np.column_stack([*flight_columns(30).values()]))
    with pytest.raises(FlightError, match="no line of the file names its columns: they are 1 to 11"):
        load_flight(tmp_path / "a.asc")
    entries = "\n".join(f'{name} = {{ source = "{k}" }}' for k, name in enumerate(flight_columns(), 1))
    flight = load_flight(tmp_path / "a.asc", parse_map(f"format = 1\n[channels]\n{entries}"))
    np.testing.assert_allclose(flight.block.column("altitude_m"), flight_columns(30)["altitude_m"])
