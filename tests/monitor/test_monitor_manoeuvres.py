"""Each manoeuvre of a live vehicle is judged within two seconds of its end, kept and announced; no restart keeps it."""

from fleet_hall import AEROSONDE, FakeCheckpoints, Hall, fly_doublets

from wingwatch.monitor import Event, VehicleMonitor
from wingwatch.monitor.fleet.member.states import KEPT_MANOEUVRES
from wingwatch.telemetry import SampleBlock

FLIGHT = fly_doublets(30.0)


def of_manoeuvres(hall: Hall) -> list[Event]:
    return [event for event in hall.fleet.events(0) if event.kind == "manoeuvre"]


def test_manoeuvres_are_judged_kept_and_told() -> None:
    hall = Hall()
    known_s: list[float] = []
    assert hall.fleet.manoeuvres("default", "uav") is None
    hall.announce()
    assert hall.fleet.manoeuvres("default", "uav") == ()
    for k in range(30):
        hall.fly(FLIGHT, k, k + 1)
        known_s += [k + 1.0] * (len(of_manoeuvres(hall)) - len(known_s))
    newest_first = hall.fleet.manoeuvres("default", "uav")
    assert newest_first is not None
    assert len(newest_first) >= 3
    assert [one.number for one in newest_first] == list(range(len(newest_first), 0, -1))
    announced = of_manoeuvres(hall)
    assert [event.data["number"] for event in announced] == [one.number for one in reversed(newest_first)]
    first = newest_first[-1]
    assert announced[0].data == {
        "fleet": "default", "vehicle": "uav", "number": 1, "begin_s": first.begin_s, "end_s": first.end_s,
        "good": first.good, "text": first.text,
    }  # fmt: skip
    for one, at_s in zip(reversed(newest_first), known_s, strict=True):
        assert one.end_s < one.known_s <= one.end_s + 2.0
        assert at_s <= one.known_s + 1.0, "with the message that brought the samples"


def test_how_samples_are_cut_into_messages_leaves_no_trace() -> None:
    found = []
    for size in (7, len(FLIGHT)):
        monitor = VehicleMonitor(AEROSONDE, "f", "v", FLIGHT.present, {}, new_id=lambda: "1")
        flown = []
        for start in range(0, len(FLIGHT), size):
            flown += monitor.feed(SampleBlock(FLIGHT.values[start : start + size])).manoeuvres
        found.append(flown)
    assert len(found[0]) >= 3
    for one, whole in zip(*found, strict=True):
        assert (one.surfaces, one.begin_s, one.end_s, one.known_s) == (
            whole.surfaces, whole.begin_s, whole.end_s, whole.known_s,
        )  # fmt: skip
        assert (one.deflections_rad == whole.deflections_rad).all()


def test_the_last_ten_are_kept_and_none_over_a_restart() -> None:
    checkpoints = FakeCheckpoints()
    hall = Hall(checkpoints=checkpoints)
    hall.announce()
    hall.fly(FLIGHT, 0, 30)
    known = hall.fleet.manoeuvres("default", "uav")
    assert known
    assert len(known) <= KEPT_MANOEUVRES == 10
    for saved in hall.fleet.unsaved():
        checkpoints.keep(saved, True)
    again = Hall(checkpoints=checkpoints)
    assert again.fleet.manoeuvres("default", "uav") == (), "made anew"
