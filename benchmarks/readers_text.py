"""Text CAN logs to decoded arrays: times as often as python-can with cantools, one thread, same file.

    python benchmarks/readers_text.py [--count 200000] [--part 40000] [--runs 3]

Figures to hold, on 5 million frames: candump ≥ 20 ×, ASC ≥ 18 ×, peak memory ≤ 160 bytes a frame, outputs included.
python-can needs minutes for so many: it reads the first `--part` frames, which stand in a file of their own. Times are
those of the processor, the best of the runs, ours and theirs in turn.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import cantools
import numpy as np
from figures import Figure, table

from nineaudit import can_bits
from nineaudit.readers.can.asc import read_asc
from nineaudit.readers.can.candump import read_candump
from nineaudit.readers.can.frames import Frames

FIGURES = {".log": 20.0, ".asc": 18.0}
READERS: dict[str, Callable[[Path], Frames]] = {".log": read_candump, ".asc": read_asc}
NAMES = {".log": "candump", ".asc": "ASC"}
MEMORY = 160
IDENTIFIERS = 24
DATABASE = 'VERSION ""\nNS_ :\nBS_:\nBU_: X\n' + "".join(
    f"BO_ {(0x98FF0000 if i % 4 == 3 else 0x100) + i} M{i}: 8 X\n"
    + "".join(f' SG_ S{j} : {16 * j}|16@1- (0.01,0) [0|0] "" X\n' for j in range(4))
    for i in range(IDENTIFIERS)
)
"""24 messages, every fourth with 29 bits, four signals each."""


def write(folder: Path, count: int) -> None:
    """Mixed frames of 24 messages on two buses as t.log and t.asc, with errors, remote frames and CAN FD."""
    rng = np.random.default_rng(5)
    with (folder / "t.log").open("w") as log, (folder / "t.asc").open("w") as asc:
        asc.write("date Tue Nov 14 22:13:20.000 2023\nbase hex  timestamps absolute\ninternal events logged\n")
        asc.write("Begin Triggerblock Tue Nov 14 22:13:20.000 2023\n   0.000000 Start of measurement\n")
        for i in range(count):
            if i % 10_000 == 0:
                which = rng.integers(0, IDENTIFIERS, 10_000).tolist()
                data = rng.integers(0, 256, (10_000, 16), dtype=np.uint8)
            n, octets = which[i % 10_000], data[i % 10_000].tobytes()
            _line(log, asc, i * 130, n, octets, i)
        asc.write("End TriggerBlock\n")


def _line(log: Any, asc: Any, micros: int, n: int, octets: bytes, i: int) -> None:
    stamp = f"({1_700_000_000 + micros // 10**6}.{micros % 10**6:06d}) can{n % 2}"
    relative = f"{micros // 10**6:4d}.{micros % 10**6:06d}"
    name = f"{0x18FF0000 + n:08X}" if n % 4 == 3 else f"{0x100 + n:03X}"
    padded = f"{name + ('x' if n % 4 == 3 else ''):<15}"
    if i % 5000 == 17:
        log.write(f"{stamp} 20000080#0000000000000000\n")
        asc.write(f"{relative} {1 + n % 2}  ErrorFrame\n")
    elif i % 5000 == 18:
        log.write(f"{stamp} {name}#R\n")
        asc.write(f"{relative} {1 + n % 2}  {padded} Rx   r\n")
    elif n == 5:
        log.write(f"{stamp} {name}##1{octets.hex().upper()} R\n")
        tail = "       0    0     3000        0        0        0        0        0"
        asc.write(f"{relative} CANFD   2 Rx {name:>10}  {'':>32} 1 0 a 16 {octets.hex(' ').upper()} {tail}\n")
    else:
        log.write(f"{stamp} {name}#{octets[:8].hex().upper()} R\n")
        asc.write(f"{relative} {1 + n % 2}  {padded} Rx   d 8 {octets[:8].hex(' ').upper()}\n")


def ours(path: Path, database: Any) -> dict[str, Any]:
    """All signals of all messages as arrays."""
    log = READERS[path.suffix](path)
    found = {}
    for message in database.messages:
        rows = log.rows_of(message.frame_id | (message.is_extended_frame << 31))
        payload, found[f"{message.name}.time"] = log.payload(rows), log.time[rows]
        for signal in message.signals:
            found[f"{message.name}.{signal.name}"] = can_bits.decode(signal, payload)
    return found


def theirs(path: Path, database: Any) -> dict[str, Any]:
    """The same through python-can and cantools."""
    known = {(m.frame_id, m.is_extended_frame): m for m in database.messages}
    found: dict[str, list[float]] = {}
    with can.LogReader(path) as reader:
        for frame in reader:
            message = known.get((frame.arbitration_id, frame.is_extended_id))
            if message is None or frame.is_remote_frame or frame.is_error_frame:
                continue
            found.setdefault(f"{message.name}.time", []).append(frame.timestamp)
            for name, value in message.decode(frame.data, decode_choices=False, allow_excess=True).items():
                found.setdefault(f"{message.name}.{name}", []).append(value)
    return {name: np.array(values) for name, values in found.items()}


def seconds(work: Callable[[Path, Any], Any], path: Path, database: Any) -> tuple[float, Any]:
    """Processor time and result."""
    start = time.process_time()
    result = work(path, database)
    return time.process_time() - start, result


def peak(path: Path) -> int:
    """Bytes that reading adds to a process of its own."""
    code = (
        "import pathlib, re, sys\n"
        "from nineaudit.readers.can.asc import read_asc\nfrom nineaudit.readers.can.candump import read_candump\n"
        "status = pathlib.Path('/proc/self/status')\n"
        "use = lambda: int(re.search(r'VmHWM:\\s+(\\d+)', status.read_text())[1])\nbefore = use()\n"
        f"log = {READERS[path.suffix].__name__}(pathlib.Path(sys.argv[1]))\nprint((use() - before) * 1024)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    return int(done.stdout)


def main() -> None:
    """Print a line for each format."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200_000)
    parser.add_argument("--part", type=int, default=40_000)
    parser.add_argument("--runs", type=int, default=3)
    asked = parser.parse_args()
    database = cantools.database.load_string(DATABASE, "dbc")
    with tempfile.TemporaryDirectory() as name:
        whole, part = Path(name) / "whole", Path(name) / "part"
        for folder, count in ((whole, asked.count), (part, min(asked.part, asked.count))):
            folder.mkdir()
            write(folder, count)
        for suffix, figure in FIGURES.items():
            fast, slow = float("inf"), float("inf")
            for _ in range(asked.runs):
                fast = min(fast, seconds(ours, whole / f"t{suffix}", database)[0])
                took, expected = seconds(theirs, part / f"t{suffix}", database)
                slow = min(slow, took)
            found = ours(part / f"t{suffix}", database)
            assert all(np.array_equal(found[n], expected[n]) for n in expected if not n.endswith(".time"))
            us, them = fast / asked.count * 1e6, slow / min(asked.part, asked.count) * 1e6
            memory = peak(whole / f"t{suffix}") / asked.count
            first = min(asked.part, asked.count)
            print(f"{suffix}: {us:.2f} µs a frame, python-can and cantools {them:.2f} µs (the first {first} frames)")
            name = NAMES[suffix]
            ratio = Figure(f"{name}: python-can and cantools / read, all decoded", them / us, ">=", figure)
            print(table([ratio, Figure(f"{name}: peak memory, bytes a frame", memory, "<=", MEMORY)]))


if __name__ == "__main__":
    main()
