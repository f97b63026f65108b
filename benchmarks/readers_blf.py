"""BLF to decoded values, against python-can, python-can with cantools, and inflating the containers alone.

    python benchmarks/readers_blf.py [--count N]

Generates a log of N mixed frames (classic, extended, FD; two fifths of them carry the signals of a rig) in a temporary
folder. All readers go over the same frames in turns, the fastest turn of each counts; python-can reads the first tenth
of them.
Times of one thread are those of the processor, so that others on the machine disturb them less; with two threads time
is that of the clock.
"""

from __future__ import annotations

import argparse
import struct
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
from figures import Figure, table

from nineaudit import can_bits
from nineaudit.readers.can.blf import read_blf

TURNS = 5
CONTAINER = 128 * 1024
SENSORS = (0x24, 0x25)
OTHERS = (0x100, 0x101, 0x180, 0x200, 0x201, 0x300, 0x98FF0001, 0x98FF0002, 0x98FEF100)
FLEXIBLE = (0x400, 0x401, 0x402)
FD_LENGTHS = {12: 9, 32: 13, 64: 15}
HEAD = [("magic", "S4"), ("header", "<u2"), ("version", "<u2"), ("size", "<u4"), ("type", "<u4"), ("unit", "<u4")]
HEAD += [("client", "<u2"), ("object", "<u2"), ("time", "<u8"), ("channel", "<u2"), ("flags", "u1"), ("dlc", "u1")]
HEAD += [("id", "<u4")]
CLASSIC = np.dtype([*HEAD, ("data", "<i2", (4,))])
FD = np.dtype(
    [*HEAD, ("ns", "<u4"), ("bits", "u1"), ("fd", "u1"), ("valid", "u1"), ("r", "V5"), ("data", "<i2", (32,))]
)


def generate(path: Path, count: int) -> None:
    """A log of that many frames, 20 at a time: 8 of the rig's sensors, 9 of others, 3 FD."""
    ids = [*SENSORS * 4, *OTHERS, *FLEXIBLE]
    order = np.random.default_rng(1).permutation(len(ids)).tolist()
    kinds = [FD if ids[i] in FLEXIBLE else CLASSIC for i in order]
    rng = np.random.default_rng(2)
    with path.open("wb") as file:
        file.write(bytes(144))
        rest = b""
        for first in range(0, count, 100_000):
            rounds = min(100_000, count - first) // len(ids)
            frames = np.zeros(rounds, dtype=[(f"f{i}", kind) for i, kind in enumerate(kinds)])
            for i, which in enumerate(order):
                fill(frames[f"f{i}"], ids[which], kinds[i], (first + np.arange(rounds) * len(ids) + i) * 20_000, rng)
            rest += frames.tobytes()
            last = first + 100_000 >= count
            while len(rest) >= CONTAINER or (last and rest):
                part, rest = rest[:CONTAINER], rest[CONTAINER:]
                body = zlib.compress(part)
                size = 32 + len(body)
                file.write(
                    struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, size, 10, 2, len(part)) + body + bytes(size % 4)
                )
        size = file.tell()
        file.seek(0)
        file.write(struct.pack("<4sL8BQQLL", b"LOGG", 144, 5, 0, 0, 0, 2, 6, 8, 1, size, 0, count // 20 * 20, 0))


def fill(frames: Any, key: int, kind: np.dtype[Any], time: Any, rng: np.random.Generator) -> None:
    """Frames of one identifier: noisy readings of sensors and in FD frames, else a counter and what hardly changes."""
    frames["magic"], frames["header"], frames["version"], frames["size"] = b"LOBJ", 32, 1, kind.itemsize
    frames["type"], frames["unit"], frames["time"], frames["id"] = 100 if kind is FD else 1, 2, time, key
    frames["channel"], frames["dlc"] = 1, 8
    if kind is FD:
        length = (12, 32, 64)[FLEXIBLE.index(key)]
        frames["dlc"], frames["valid"], frames["fd"] = FD_LENGTHS[length], length, 3
        frames["data"][:, : length // 2] = rng.normal(0, 200, (len(frames), length // 2))
    elif key in SENSORS:
        frames["data"] = rng.normal(0, 200, (len(frames), 4))
    else:
        frames["data"][:, 0] = np.arange(len(frames)) % 16
        frames["data"][:, 1] = rng.normal(0, 2, len(frames)).cumsum()


def database(keys: Sequence[int]) -> Any:
    """Messages of four 16-bit signals, as cantools has them."""
    from cantools.database import load_string

    lines = ['VERSION ""', "BS_:", "BU_: R"]
    for key in keys:
        lines.append(f"BO_ {key} M{key}: 8 R")
        lines += [f' SG_ S{key}_{i} : {16 * i}|16@1- (0.1,0) [0|0] "" R' for i in range(4)]
    return load_string("\n".join(lines) + "\n", "dbc").messages


def ours(path: Path, messages: Any, threads: int) -> int:
    """Frames read and their signals decoded."""
    log = read_blf(path, threads)
    for message in messages:
        payload = log.payload(log.rows_of(message.frame_id | message.is_extended_frame << 31))
        for signal in message.signals:
            can_bits.decode(signal, payload)
    return len(log)


def decoded(message: Any, payload: Any) -> None:
    """The signals of a message alone."""
    for signal in message.signals:
        can_bits.decode(signal, payload)


def inflate(path: Path) -> None:
    """The containers alone, from file to bytes."""
    with path.open("rb") as file:
        file.seek(144)
        while head := file.read(32):
            size, stated = struct.unpack_from("<L", head, 8)[0], struct.unpack_from("<L", head, 24)[0]
            zlib.decompress(file.read(size - 32), bufsize=stated)
            file.seek(size % 4, 1)


def python_can(path: Path, messages: Any = ()) -> None:
    """Frames read by python-can, and decoded by cantools if `messages` are given."""
    import can

    known = {message.frame_id: message for message in messages}  # the generated ones differ without the flag too
    with can.BLFReader(path) as log:
        for frame in log:
            if frame.arbitration_id in known:
                known[frame.arbitration_id].decode(frame.data)


def turns(runs: dict[str, tuple[Callable[[], object], int, Callable[[], float]]]) -> dict[str, float]:
    """Seconds a frame of each run: (what to do, frames in it, the clock), all in turns, the fastest of each."""
    best = dict.fromkeys(runs, float("inf"))
    for _ in range(TURNS):
        for name, (run, count, clock) in runs.items():
            start = clock()
            run()
            best[name] = min(best[name], (clock() - start) / count)
    return best


def memory(path: Path) -> float:
    """Peak bytes a frame of a process that reads the log, beyond what it had before (of Linux: VmHWM and VmRSS)."""
    before = status("VmRSS")
    log = read_blf(path)
    return (status("VmHWM") - before) * 1024 / len(log)


def status(key: str) -> int:
    """KiB, as the system has it for this process."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return int(next(line for line in lines if line.startswith(key)).split()[1])


def compare(count: int) -> None:
    """Generate, measure, print."""
    few, all_ = database(SENSORS), database([*SENSORS, *OTHERS, *FLEXIBLE])
    with tempfile.TemporaryDirectory() as folder:
        whole, part = Path(folder) / "whole.blf", Path(folder) / "part.blf"
        generate(whole, count)
        generate(part, count // 10)
        payload = np.random.default_rng(3).integers(0, 256, (count // 4, 8), dtype=np.uint8)
        best = turns(
            {
                "decode, a value": (lambda: decoded(few[0], payload), count // 4 * 4, process_time),
                "inflate": (lambda: inflate(whole), count, process_time),
                "read": (lambda: read_blf(whole), count, process_time),
                "rig": (lambda: ours(whole, few, 1), count, process_time),
                "all": (lambda: ours(whole, all_, 1), count, process_time),
                "two threads": (lambda: ours(whole, few, 2), count, perf_counter),
                "python-can": (lambda: python_can(part), count // 10, process_time),
                "cantools, rig": (lambda: python_can(part, few), count // 10, process_time),
                "cantools, all": (lambda: python_can(part, all_), count // 10, process_time),
            }
        )
        command = [sys.executable, __file__, "--memory", str(whole)]
        peak = float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
        print(f"{count} frames, {whole.stat().st_size / count:.1f} bytes a frame in the file")
    print(f"nanoseconds a frame; of python-can and cantools measured on the first {count // 10} frames:")
    for name, seconds in best.items():
        print(f"  {name:<20} {1e9 * seconds:8.1f}")
    read, every = best["read"] / best["inflate"], best["all"] / best["inflate"]
    print(f"read / inflate {read:.2f}, with all decoded {every:.2f}; with cantools / read, the rig's decoded", end="")
    print(f" {best['cantools, rig'] / best['rig']:.1f}")
    figures = (
        Figure("BLF: python-can alone / read, the rig's decoded", best["python-can"] / best["rig"], ">=", 6),
        Figure("BLF: python-can and cantools / read, all decoded", best["cantools, all"] / best["all"], ">=", 18),
        Figure("BLF: read, the rig's decoded / inflating alone", best["rig"] / best["inflate"], "<=", 2.3),
        Figure("BLF: million frames/s, two threads, decoded", 1e-6 / best["two threads"], ">=", 2),
        Figure("BLF: peak memory, bytes a frame", peak, "<=", 160),
        Figure("decode: million values/s", 1e-6 / best["decode, a value"], ">=", 100),
    )
    print(table(figures))


def main() -> None:
    """Arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500_000)
    parser.add_argument("--memory", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.memory:
        print(memory(arguments.memory))
    else:
        compare(arguments.count // 200 * 200)


if __name__ == "__main__":
    main()
