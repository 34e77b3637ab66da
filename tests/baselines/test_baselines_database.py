"""What goes into the database comes out the same, on SQLite and (where a server is given) on PostgreSQL."""

import json
import math
import threading
from dataclasses import replace

import numpy as np
import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from sqlalchemy import inspect, text

from wingwatch.aircraft import SHORT_PERIOD, FlightCondition, Provenance
from wingwatch.baselines import (
    AlertRecord,
    CandidateRecord,
    Cell,
    Database,
    DatabaseError,
    EstimateRecord,
    EvidenceRecord,
    Expectation,
    ExpectationRecord,
    Reference,
    ReferenceKey,
    open_database,
)
from wingwatch.baselines import baseline_rows as rows_module
from wingwatch.baselines import connection as connection_module
from wingwatch.baselines.connection import VERSION_TABLE, connect, revision_of, writing
from wingwatch.baselines.tables import Base
from wingwatch.estimators.estimate import Estimate, Outcome

NASTY = (0.1, 1.0 / 3.0, -0.0, 5e-324, 1.7976931348623157e308, math.pi, -1e-17, 2.0**53 + 1.0)
"""Floats that lose a bit wherever text is printed with fewer than 17 digits."""


def entry(**changes: object) -> ExpectationRecord:
    covariance = np.outer(NASTY[:4] * 2, NASTY[:4] * 2)[:6, :6]
    covariance[3, 3] = NASTY[4]
    record = ExpectationRecord(
        aircraft="aerosonde",
        configuration="clean",
        structure="short_period",
        airspeed_true_m_s=25.1,
        altitude_m=1000.0 / 3.0,
        air_density_kg_m3=1.1 + 1e-16,
        angle_of_attack_rad=0.1,
        value=NASTY[:6],
        covariance=tuple(map(tuple, covariance.tolist())),
        provenance="identified",
        source="flight 7, 'doublets'; ζ = 0.4",
        created_at_s=1.7e9 + 0.1,
    )
    return replace(record, **changes)  # type: ignore[arg-type]


def alert(alert_id: str = "a1", **changes: object) -> AlertRecord:
    record = AlertRecord(
        id=alert_id,
        fleet="default",
        vehicle="uav-1",
        kind="icing",
        cause="icing",
        level="warning",
        state="active",
        raised_s=61.02,
        cleared_s=None,
        size=0.0675,
        size_standard_error=1.0 / 3.0,
        probability=0.97,
        basis="a-priori",
        text="Ice: η = 0.07 ± 0.01; leave the cloud.",
        evidence=(EvidenceRecord("m_q", -6.035, 0.3, -6.5, math.inf, math.nan),),
        created_at_s=1.7e9,
        updated_at_s=1.7e9,
        note=("NaN", "who: why"),
        shelving={"until_at_s": 1.7e9 + 1 / 3, "level": "warning", "size": math.inf},
        channel="pitch_rate_rad_s",
        candidates=(
            CandidateRecord("sensor_bias", "pitch_rate_rad_s", 1.0 / 3.0),
            CandidateRecord("icing", None, math.nan),
        ),
    )
    return replace(record, **changes)  # type: ignore[arg-type]


def estimate(time_s: float, vehicle: str = "uav-1") -> EstimateRecord:
    return EstimateRecord(
        "default", vehicle, time_s, "short_period", "fourier", NASTY[:6], (0.1,) * 6, "converged",
        (25.0, 1000.0, 1.1, 0.05),
    )  # fmt: skip


KEY = ReferenceKey("default", "uav-1", "aerosonde", "clean", "short_period")


def same(a: object, b: object) -> bool:
    """Equal, with NaN equal to NaN and -0.0 unlike 0.0."""
    return repr(a) == repr(b)


def test_migrations_make_the_schema_of_the_tables(database: Database, url: str) -> None:
    engine = connect(url, 1.0)
    with engine.connect() as connection:
        context = MigrationContext.configure(
            connection, opts={"version_table": VERSION_TABLE, "compare_type": True}
        )
        assert compare_metadata(context, Base.metadata) == []
    engine.dispose()


def test_opening_again_keeps_what_is_there(url: str) -> None:
    with open_database(url) as first:
        first.save_alert(alert())
    with open_database(url) as second:
        assert second.alert("a1") is not None
        second.check()


def test_an_expectation_comes_back_bit_for_bit(database: Database) -> None:
    stored = database.put_expectation(entry())
    assert stored.id is not None
    assert same(database.expectations("aerosonde", "clean", "short_period"), (stored,))
    assert same(replace(stored, id=None), entry())


def test_a_new_entry_at_the_same_point_makes_the_old_one_history(database: Database) -> None:
    first = database.put_expectation(entry(provenance="a-priori"))
    elsewhere = database.put_expectation(entry(airspeed_true_m_s=20.0))
    second = database.put_expectation(entry(provenance="empirical"))
    third = database.put_expectation(entry())
    current = database.expectations("aerosonde", "clean", "short_period")
    assert [e.id for e in current] == [elsewhere.id, third.id]
    past = database.history("aerosonde", "clean", "short_period")
    assert [(e.id, e.superseded_by) for e in past] == [
        (first.id, second.id),
        (elsewhere.id, None),
        (second.id, third.id),
        (third.id, None),
    ]
    assert [e.provenance for e in past] == ["a-priori", "identified", "empirical", "identified"]


def test_entries_of_other_series_do_not_mix(database: Database) -> None:
    database.put_expectation(entry())
    for other in ({"aircraft": "x"}, {"configuration": "flaps"}, {"structure": "dutch_roll"}):
        database.put_expectation(entry(**other))
    assert len(database.expectations("aerosonde", "clean", "short_period")) == 1
    assert database.expectations("nobody", "clean", "short_period") == ()


def test_a_stored_entry_cannot_be_put_twice(database: Database) -> None:
    stored = database.put_expectation(entry())
    with pytest.raises(ValueError, match="already stored"):
        database.put_expectation(stored)


def test_an_expectation_survives_as_a_point_of_an_envelope(database: Database) -> None:
    condition = FlightCondition(25.1, 1000.0, 1.05, angle_of_attack_rad=0.07)
    point = Expectation(
        SHORT_PERIOD, np.array(NASTY[:6]), np.diag([0.1] * 6), Provenance.IDENTIFIED, condition, "flight 7"
    )
    database.put_expectation(ExpectationRecord.of("aerosonde", point, 1.0))
    (back,) = database.expectations("aerosonde", "clean", "short_period")
    assert back.expectation.value.tobytes() == point.value.tobytes()
    assert back.expectation.covariance.tobytes() == point.covariance.tobytes()
    assert back.expectation.condition == condition
    assert back.expectation.provenance is Provenance.IDENTIFIED
    assert back.expectation.source == "flight 7"


def test_a_reference_comes_back_bit_for_bit_and_keeps_its_history(database: Database) -> None:
    assert database.load_reference(KEY) is None
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6))
    first = Reference.empty(6).add(root @ root.T, rng.normal(size=6), 12.3)
    second = first.add(np.eye(6) / 3.0, rng.normal(size=6), 1.0 / 3.0)
    database.save_reference(KEY, first, 100.0)
    database.save_reference(KEY, second, 200.0)
    database.save_reference(replace(KEY, vehicle="uav-2"), first, 300.0)
    loaded = database.load_reference(KEY)
    assert loaded is not None
    assert loaded.to_dict() == second.to_dict()
    assert loaded.information.tobytes() == second.information.tobytes()
    versions = database.reference_history(KEY)
    assert [v.updated_at_s for v in versions] == [100.0, 200.0]
    assert versions[0].reference.to_dict() == first.to_dict()


def test_the_history_of_a_reference_is_bounded(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rows_module, "MAX_REFERENCE_HISTORY", 3)
    for i in range(5):
        database.save_reference(KEY, Reference.empty(1).add([[1.0]], [0.0], float(i)), float(i))
    assert [v.updated_at_s for v in database.reference_history(KEY)] == [2.0, 3.0, 4.0]


def test_an_alert_comes_back_whole(database: Database) -> None:
    database.save_alert(alert())
    assert same(database.alert("a1"), alert())
    assert database.alert("unknown") is None


def test_an_alert_of_the_airframe_without_candidates_comes_back_so(database: Database) -> None:
    database.save_alert(alert())
    plain = alert(channel=None, candidates=(), evidence=(), shelving=None)
    database.save_alert(plain)
    assert same(database.alert("a1"), plain)


def migrate(where: str, to: str) -> None:
    """Bring a database's schema up or down to a revision."""
    engine = connect(where, 1.0)
    with writing(engine).begin() as connection:
        config = Config(attributes={"connection": connection, "version_table": VERSION_TABLE})
        config.set_main_option("script_location", str(connection_module._MIGRATIONS))
        current = revision_of(connection) or ""
        (command.upgrade if current < to else command.downgrade)(config, to)
    engine.dispose()


def test_alerts_of_older_versions_have_no_part_and_no_candidates(url: str) -> None:
    migrate(url, "0005")
    engine = connect(url, 1.0)
    values = {"text": "Ice.", "evidence": "[]", "note": "[]"}
    with writing(engine).begin() as connection:
        connection.execute(
            text(
                "INSERT INTO alert (id, fleet, vehicle, kind, cause, level, state, raised_s, basis, text, evidence, "
                "note, created_at_s, updated_at_s) VALUES ('old', 'default', 'uav-1', 'icing', 'icing', 'watch', "
                "'active', 1.0, 'a-priori', :text, :evidence, :note, 1.0, 1.0)"
            ),
            values,
        )
    engine.dispose()
    with open_database(url) as database:
        old = database.alert("old")
        assert old is not None
        assert (old.channel, old.candidates, old.text) == (None, (), "Ice.")
        database.save_alert(alert("new"))
        database.save_alert(replace(old, channel="throttle"))
        assert [a.channel for a in database.alerts().items] == ["pitch_rate_rad_s", "throttle"]


def test_the_schema_goes_back_and_forth_with_its_alerts(url: str) -> None:
    with open_database(url) as database:
        database.save_alert(alert())
    migrate(url, "0005")
    engine = connect(url, 1.0)
    assert not {"channel", "candidates"} & {c["name"] for c in inspect(engine).get_columns("alert")}
    engine.dispose()
    with open_database(url) as database:
        assert same(database.alert("a1"), alert(channel=None, candidates=()))


def test_an_alert_of_unknown_size_keeps_its_nan(database: Database) -> None:
    unexplained = alert(size=math.nan, size_standard_error=math.inf, probability=math.nan, kind="unexplained")
    database.save_alert(unexplained)
    assert same(database.alert("a1"), unexplained)


def test_an_alert_saved_again_replaces_its_former_self_and_keeps_its_place_and_date(
    database: Database,
) -> None:
    database.save_alert(alert())
    database.save_alert(alert("a2"))
    cleared = alert(state="cleared", cleared_s=99.5, updated_at_s=1.7e9 + 5, note=("ops: gone",))
    database.save_alert(replace(cleared, created_at_s=1.7e9 + 5))
    assert same(database.alert("a1"), cleared)
    assert same(database.alert("a2"), alert("a2"))
    assert [a.id for a in database.alerts().items] == ["a2", "a1"]


def test_what_is_saved_twice_is_there_once(database: Database) -> None:
    """Whoever lost the reply to a write cannot know whether it was done."""
    learned = Reference.empty(2).add(np.eye(2), np.ones(2), 10.0)
    for _ in range(2):
        database.save_alert(alert())
        database.save_reference(KEY, learned, 100.0)
    assert len(database.alerts().items) == 1
    assert len(database.reference_history(KEY)) == 1


def test_alerts_are_filtered_by_every_field_given(database: Database) -> None:
    database.save_alert(alert("a"))
    database.save_alert(alert("b", state="cleared"))
    database.save_alert(alert("c", vehicle="uav-2", raised_s=70.0))
    database.save_alert(alert("d", fleet="north", kind="damage", channel="throttle"))

    def ids(**filters: object) -> list[str]:
        return [x.id for x in database.alerts(**filters).items]  # type: ignore[arg-type]

    assert ids() == ["d", "c", "b", "a"]
    assert ids(state="active") == ["d", "c", "a"]
    assert ids(vehicle="uav-2") == ["c"]
    assert ids(fleet="default", state="active") == ["c", "a"]
    assert ids(kind="damage") == ["d"]
    assert ids(since_s=61.02) == ["d", "c", "b", "a"]
    assert ids(since_s=61.03) == ["c"]
    assert ids(vehicle="'; drop table alert; --") == []


def test_pages_give_every_alert_once_while_new_ones_arrive(database: Database) -> None:
    for i in range(5):
        database.save_alert(alert(f"a{i}"))
    page = database.alerts(limit=2)
    seen = [x.id for x in page.items]
    database.save_alert(alert("late"))
    while page.next is not None:
        page = database.alerts(limit=2, cursor=page.next)
        seen += [x.id for x in page.items]
    assert seen == ["a4", "a3", "a2", "a1", "a0"]


@pytest.mark.parametrize("cursor", ["", "xyz", "-1", "f" * 40, "1; drop"])
def test_a_cursor_that_no_page_gave_is_refused(database: Database, cursor: str) -> None:
    with pytest.raises(ValueError, match="start without a cursor"):
        database.alerts(cursor=cursor)


@pytest.mark.parametrize("limit", [0, -1, 1001])
def test_the_size_of_a_page_is_limited(database: Database, limit: int) -> None:
    with pytest.raises(ValueError, match=f"limit is {limit}; give 1 to 1000"):
        database.alerts(limit=limit)


def test_estimates_come_back_by_time_within_the_window(database: Database) -> None:
    rows = [estimate(t) for t in (0.5, 1.0, 1.5, 2.0)]
    database.append_estimates([(row, 1000.0) for row in (*rows, estimate(1.0, "uav-2"))])
    database.append_estimates([])
    back = database.estimate_history("default", "uav-1", 1.0, 1.5)
    assert same(back, (rows[1], rows[2]))
    assert [r.time_s for r in database.estimate_history("default", "uav-1")] == [0.5, 1.0, 1.5, 2.0]
    assert [r.time_s for r in database.estimate_history("default", "uav-1", limit=2)] == [0.5, 1.0]
    assert database.estimate_history("north", "uav-1") == ()


def test_an_estimate_that_knows_nothing_yet_is_kept_as_it_is(database: Database) -> None:
    unknown = Estimate(
        estimator="ekf",
        structure=SHORT_PERIOD,
        time_s=1.0,
        value=np.array([math.nan, *NASTY[:5]]),
        covariance=np.diag([math.inf, 1.0, 4.0, 9.0, 16.0, 25.0]),
        outcomes=(Outcome.NOT_OBSERVABLE,) * 6,
        outcome=Outcome.NOT_OBSERVABLE,
        reason="the elevator does not move",
        condition=(25.0, 1000.0, 1.1, math.nan),
    )
    record = EstimateRecord.of("default", "uav-1", unknown)
    assert record.standard_error == (math.inf, 1.0, 2.0, 3.0, 4.0, 5.0)
    database.append_estimates([(record, 1000.0)])
    assert same(database.estimate_history("default", "uav-1"), (record,))


def test_many_threads_may_use_one_database(database: Database) -> None:
    faults: list[BaseException] = []

    def work(n: int) -> None:
        try:
            for i in range(10):
                database.append_estimates([(estimate(float(i), f"v{n}"), 1000.0)])
                database.save_alert(alert(f"{n}-{i}"))
                database.put_expectation(entry(value=(float(n),) * 6))
                database.alerts(limit=5)
                database.check()
        except BaseException as fault:
            faults.append(fault)

    threads = [threading.Thread(target=work, args=(n,)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [str(f) for f in faults] == []
    page = database.alerts(limit=1000)
    assert len(page.items) == 40
    assert all(len(database.estimate_history("default", f"v{n}")) == 10 for n in range(4))
    assert len(database.expectations("aerosonde", "clean", "short_period")) == 1
    assert len(database.history("aerosonde", "clean", "short_period")) == 40


def test_stored_numbers_are_plain_json(database: Database, url: str) -> None:
    database.save_alert(alert())
    engine = connect(url, 1.0)
    with engine.connect() as connection:
        stored = connection.execute(text("SELECT CAST(evidence AS VARCHAR) FROM alert")).scalar_one()
    engine.dispose()

    def refuse(constant: str) -> object:
        raise AssertionError(f"{constant} is not JSON")

    assert json.loads(stored, parse_constant=refuse)[0]["z"] == "NaN"


def test_what_a_cell_taught_comes_back_bit_for_bit_with_its_age(database: Database) -> None:
    key = ReferenceKey("default", "uav1", "aerosonde", "clean", "short_period")
    first = Reference.empty(2).add(np.array([[2.0, 0.1], [0.1, 1.0 / 3.0]]), np.array([0.1, math.pi]), 10.0)
    more = first.add(np.eye(2), np.ones(2), 10.0)
    database.save_cell(key, Cell(23, 1), first, 1000.0)
    database.save_cell(key, Cell(24, -1), more, 1500.0)
    database.save_cell(key, Cell(23, 1), more, 2000.0)
    found = database.load_cells(key, 2600.0)
    assert {cell: memory.age_s for cell, memory in found.items()} == {
        Cell(23, 1): 600.0,
        Cell(24, -1): 1100.0,
    }
    assert found[Cell(23, 1)].reference.to_dict() == more.to_dict()
    assert database.load_cells(replace(key, vehicle="uav2"), 2600.0) == {}
    assert database.load_cells(key, 0.0)[Cell(23, 1)].age_s == 0.0  # a clock that was put back


def test_a_vehicle_keeps_a_bounded_number_of_cells(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rows_module, "MAX_CELLS", 3)
    key = ReferenceKey("default", "uav1", "aerosonde", "clean", "short_period")
    for k in range(5):
        database.save_cell(key, Cell(k, 0), Reference.empty(2), float(k))
    assert sorted(database.load_cells(key, 10.0)) == [Cell(2, 0), Cell(3, 0), Cell(4, 0)]


def test_a_statement_that_takes_too_long_is_stopped(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """PostgreSQL stops it by the clock; SQLite, in this process, waits for a lock only."""
    monkeypatch.setattr(connection_module, "STATEMENT_TIMEOUT_S", 0.2)
    if "postgresql" not in url:
        pytest.skip("SQLite has no statement that waits")
    engine = connect(url, 1.0)
    with (
        pytest.raises(DatabaseError, match="took too long to answer"),
        connection_module.sentences(engine),
        engine.connect() as connection,
    ):
        connection.execute(text("SELECT pg_sleep(5)"))
    with engine.connect() as connection:
        assert connection.execute(text("SHOW lock_timeout")).scalar_one() == "1s"
    engine.dispose()
    with open_database(url) as database:  # migrations are not held to it
        assert database.alerts().items == ()
