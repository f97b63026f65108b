"""MCAP logs read with every checksum verified: ours against the mcap library and its decoders, in one run.

    python benchmarks/readers_mcap.py --count 60000

Both sides give the log times and six numbers a message. The issue asks for 600,000 messages; the library alone needs
minutes for them, and the ratio does not depend on the count.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from figures import Figure, table

from nineaudit.readers.mcap.reader import read_mcap
from nineaudit.rig import parse_rig

ASKED = {"ros2": 40.0, "protobuf": 10.0, "json": 2.5}
FIELDS = [f"{vector}.{axis}" for vector in ("linear_acceleration", "angular_velocity") for axis in "xyz"]
VECTOR = "float64 x\nfloat64 y\nfloat64 z\n"
RULE = "=" * 80
IMU = f"""std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
{RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{RULE}
MSG: geometry_msgs/Quaternion
{VECTOR}float64 w
{RULE}
MSG: geometry_msgs/Vector3
{VECTOR}{RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def messages(count: int) -> list[dict[str, Any]]:
    """Messages of an IMU with noise."""
    draw = random.Random(5)
    vectors = [{axis: draw.gauss(0, 10) for axis in "xyz"} for _ in range(2 * count)]
    return [
        {
            "header": {"stamp": {"sec": i // 1000, "nanosec": i % 1000 * 10**6}, "frame_id": "imu_link"},
            "linear_acceleration": vectors[2 * i],
            "angular_velocity": vectors[2 * i + 1],
        }
        for i in range(count)
    ]


def write_ros2(path: Path, count: int) -> None:
    """sensor_msgs/Imu in CDR."""
    from mcap_ros2.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        schema = writer.register_msgdef("sensor_msgs/msg/Imu", IMU)
        for i, message in enumerate(messages(count)):
            writer.write_message("/imu", schema, message, log_time=i * 10**6, publish_time=i * 10**6, sequence=i)
        writer.finish()


def write_json(path: Path, count: int) -> None:
    """The same as JSON."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file, enable_data_crcs=True)
        writer.start()
        channel = writer.register_channel("/imu", "json", writer.register_schema("Imu", "jsonschema", b"{}"))
        for i, message in enumerate(messages(count)):
            writer.add_message(channel, log_time=i * 10**6, publish_time=i * 10**6, data=json.dumps(message).encode())
        writer.finish()


def imu_class() -> Any:
    """A protobuf class of the same fields."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    file = descriptor_pb2.FileDescriptorProto(name="imu.proto", package="bench", syntax="proto3")

    def add(name: str, *fields: tuple[str, int, str]) -> None:
        made = file.message_type.add(name=name)
        for number, (field, kind, of) in enumerate(fields, 1):
            made.field.add(name=field, number=number, type=kind, label=1, type_name=of or None)

    add("Stamp", ("sec", 3, ""), ("nanosec", 5, ""))
    add("Header", ("stamp", 11, ".bench.Stamp"), ("frame_id", 9, ""))
    add("Vector", ("x", 1, ""), ("y", 1, ""), ("z", 1, ""))
    vector = (11, ".bench.Vector")
    add("Imu", ("header", 11, ".bench.Header"), ("linear_acceleration", *vector), ("angular_velocity", *vector))
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("bench.Imu"))


def write_protobuf(path: Path, count: int) -> None:
    """The same as protobuf."""
    from mcap_protobuf.writer import Writer

    kind = imu_class()
    with path.open("wb") as file, Writer(file) as writer:
        for i, message in enumerate(messages(count)):
            writer.write_message("/imu", kind(**message), log_time=i * 10**6, publish_time=i * 10**6, sequence=i)


def by_library(path: Path, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Log times and (n,6) numbers as the mcap library and its decoder give them, checksums verified."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory as Protobuf
    from mcap_ros2.decoder import DecoderFactory as Ros2

    factory = {"ros2": Ros2, "protobuf": Protobuf}.get(kind)
    times, values = [], []
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[factory()] if factory else [])
        if factory is None:
            for _, _, message in reader.iter_messages(log_time_order=False):
                data = json.loads(message.data)
                times.append(message.log_time)
                values.append([data[v][a] for v in ("linear_acceleration", "angular_velocity") for a in "xyz"])
        else:
            for _, _, message, data in reader.iter_decoded_messages(log_time_order=False):
                a, w = data.linear_acceleration, data.angular_velocity
                times.append(message.log_time)
                values.append((a.x, a.y, a.z, w.x, w.y, w.z))
    return np.array(times), np.array(values)


def rig_of(fields: list[str]) -> Any:
    """A rig whose sensors are fields of /imu."""
    sensors = "".join(
        f'[[sensor]]\nchannel="c{k}"\nkind="accelerometer"\nposition=[0,0,0]\naxis=[1,0,0]\nsignal="/imu:{field}"\n'
        for k, field in enumerate(fields)
    )
    return parse_rig('[rig]\nname="bench"\n[units]\nacceleration="m/s^2"\n' + sensors)


def timed(call: Callable[[], Any], times: int = 1) -> tuple[tuple[float, float], Any]:
    """Least seconds of processor and of wall clock of a call, and what it gave. Both sides run in one thread, so that
    the ratio of processor times is theirs on a machine that others use too."""
    spent, found = [], None
    for _ in range(times):
        start = time.process_time(), time.perf_counter()
        found = call()
        spent.append((time.process_time() - start[0], time.perf_counter() - start[1]))
    return (min(s for s, _ in spent), min(s for _, s in spent)), found


def main(argv: list[str] | None = None) -> int:
    """Prints one line an encoding; 1 where one falls short of what is asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=30_000, help="messages of each log")
    count = parser.parse_args(argv).count
    rig, short = rig_of(FIELDS), 0
    writers = {"ros2": write_ros2, "protobuf": write_protobuf, "json": write_json}
    with tempfile.TemporaryDirectory() as folder:
        for kind, write in writers.items():
            path = Path(folder) / f"{kind}.mcap"
            write(path, count)
            read_mcap(path, rig)  # imports
            ours, contents = timed(lambda path=path: read_mcap(path, rig), 3)
            theirs, (_, values) = timed(lambda path=path, kind=kind: by_library(path, kind))
            equal = all(np.array_equal(t.values, v) for t, v in zip(contents.traces, values.T, strict=True))
            ratio, wall = (slow / fast for slow, fast in zip(theirs, ours, strict=True))
            short += ratio < ASKED[kind] or not equal or bool(contents.damage)
            size = path.stat().st_size / 1e6
            print(
                f"{kind:9s} {count} messages, {size:.1f} MB: ours {ours[0]:.3f} s, library {theirs[0]:.2f} s, ", end=""
            )
            print(f"ratio {ratio:.1f} (wall clock {wall:.1f}); ", end="")
            print("values equal" if equal else "values DIFFER")
            print(table([Figure(f"MCAP {kind}: mcap and its decoder / read, with CRC", ratio, ">=", ASKED[kind])]))
    return int(short > 0)


if __name__ == "__main__":
    sys.exit(main())
