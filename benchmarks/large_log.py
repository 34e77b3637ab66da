"""How long a large log takes to be read and how much memory, by format.

The logs are written here: gyros and accelerometers at 400 Hz from three instances, rates, attitude, outputs and what
else autopilots log, as random numbers; an aircraft flies in them no better than noise does, and reading them does not
mind. ``wingwatch log FILE`` runs in a process of its own, whose peak of memory is the system's count.

Run: python benchmarks/large_log.py [--megabytes 64 500] [--formats ulog dataflash] [--seed 1]
"""

import argparse
import resource
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from saving import run_benchmark

TOPICS: Mapping[str, tuple[int, int, int]] = {
    "sensor_gyro_fifo": (3, 400, 24), "sensor_combined": (1, 250, 8), "vehicle_angular_velocity": (1, 250, 3),
    "vehicle_acceleration": (1, 250, 3), "vehicle_attitude": (1, 100, 4), "actuator_servos": (1, 100, 8),
    "actuator_outputs": (1, 100, 16), "estimator_states": (2, 50, 24), "estimator_innovations": (2, 50, 24),
    "vehicle_local_position": (1, 50, 20), "airspeed": (1, 10, 3), "vehicle_air_data": (1, 10, 5),
}  # fmt: skip
"""Instances, messages a second, and numbers in a message."""


def ulog(megabytes: float, seed: int) -> bytes:
    """A file of PX4's logger."""
    draw = np.random.default_rng(seed)
    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message(b"B", bytes(40))]
    out.append(message(b"I", bytes((16,)) + b"char[3] sys_name" + b"PX4"))
    for name, (_, _, width) in TOPICS.items():
        out.append(message(b"F", f"{name}:uint64_t timestamp;float[{width}] x;".encode()))
    out.append(message(b"P", bytes((16,)) + b"int32_t MAV_TYPE" + struct.pack("<i", 1)))
    streams = [(name, k) for name, (instances, _, _) in TOPICS.items() for k in range(instances)]
    for number, (name, instance) in enumerate(streams):
        out.append(message(b"A", struct.pack("<BH", instance, number) + name.encode()))

    def second(at_s: int) -> bytes:
        parts = []
        for number, (name, _) in enumerate(streams):
            _, rate, width = TOPICS[name]
            kind = np.dtype(
                [("size", "<u2"), ("type", "S1"), ("id", "<u2"), ("time", "<u8"), ("x", "<f4", width)]
            )
            rows = np.zeros(rate, dtype=kind)
            rows["size"], rows["type"], rows["id"] = kind.itemsize - 3, b"D", number
            rows["time"] = 1_000_000 * at_s + np.arange(rate) * (1_000_000 // rate)
            rows["x"] = draw.standard_normal((rate, width))
            parts.append(rows.tobytes())
        return b"".join(parts)

    return b"".join(out) + filled(second, megabytes)


def dataflash(megabytes: float, seed: int) -> bytes:
    """A binary log of ArduPilot."""
    draw = np.random.default_rng(seed)
    out = []
    kinds = {}
    for number, (name, (_, _, width)) in enumerate(TOPICS.items(), 1):
        width = min(width, 12)
        columns = ",".join(["TimeUS", "I", *(f"X{k}" for k in range(width))])
        short, codes = f"T{number:02d}", "QB" + "f" * width
        length = 3 + 8 + 1 + 4 * width
        text = (
            short.encode().ljust(4, b"\0"),
            codes.encode().ljust(16, b"\0"),
            columns.encode().ljust(64, b"\0"),
        )
        out.append(b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", number, length, *text))
        kinds[name] = number, width

    def second(at_s: int) -> bytes:
        parts = []
        for name, (instances, rate, _) in TOPICS.items():
            number, width = kinds[name]
            kind = np.dtype(
                [("head", "S2"), ("type", "u1"), ("time", "<u8"), ("i", "u1"), ("x", "<f4", width)]
            )
            for instance in range(instances):
                rows = np.zeros(rate, dtype=kind)
                rows["head"], rows["type"], rows["i"] = b"\xa3\x95", number, instance
                rows["time"] = 1_000_000 * at_s + np.arange(rate) * (1_000_000 // rate)
                rows["x"] = draw.standard_normal((rate, width))
                parts.append(rows.tobytes())
        return b"".join(parts)

    return b"".join(out) + filled(second, megabytes)


def filled(second: Callable[[int], bytes], megabytes: float) -> bytes:
    """Seconds of a log until it is that large."""
    parts, size, at_s = [], 0, 1
    while size < 1e6 * megabytes:
        part = second(at_s)
        parts.append(part)
        size, at_s = size + len(part), at_s + 1
    return b"".join(parts)


def message(kind: bytes, body: bytes) -> bytes:
    """One of ULog's."""
    return struct.pack("<H", len(body)) + kind + body


WRITERS: Mapping[str, Callable[[float, int], bytes]] = {"ulog": ulog, "dataflash": dataflash}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--megabytes", type=float, nargs="+", default=[64.0, 500.0])
    parser.add_argument("--formats", nargs="+", choices=sorted(WRITERS), default=sorted(WRITERS))
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for megabytes in arguments.megabytes:
            for form in arguments.formats:
                path = Path(folder) / f"log.{form}"
                path.write_bytes(WRITERS[form](megabytes, arguments.seed))
                command = [sys.executable, __file__, "--child", str(path)]
                print(
                    f"{form}, {megabytes:g} MB: {subprocess.check_output(command, text=True).strip()}",
                    flush=True,
                )
                path.unlink()


def child(path: str) -> None:
    """Read one log in this process, and say what it took."""
    from wingwatch.cli.main import main as wingwatch

    began_s = time.monotonic()
    with open("/dev/null", "w") as nowhere:
        shown, sys.stdout = sys.stdout, nowhere
        code = wingwatch(["log", path, "--json"])
        sys.stdout = shown
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"exit {code}, {time.monotonic() - began_s:.1f} s, {peak_mb:.0f} MiB at most")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2])
    else:
        run_benchmark(main)
