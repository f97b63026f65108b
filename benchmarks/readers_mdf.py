"""MF4: raw frames to decoded signals, against asammdf's own extract_bus_logging, on the same file in turns.

    python benchmarks/readers_mdf.py [--count N] [--plain]

Generates a log of N frames at 10 kHz, as ASAM bus logging has them: of 20 frames 17 are classic (8 with 11 bits, 9
with 29), 3 FD of 12, 32 and 64 bytes, which are in a group of their own; with --plain all are classic with 11 bits.
Times are those of the processor, so that others on the machine disturb them less.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from nineaudit.can_bits import decode
from nineaudit.can_database import EXTENDED, load_databases
from nineaudit.readers.can.mdf import read_mdf

ASKED, ASKED_MEMORY, TURNS = 2.5, 160, 5
MESSAGES, SIGNALS, STANDARD, CLASSIC = 20, 4, 8, 17
FD_LENGTHS = {12: 9, 32: 13, 64: 15}


def identifiers(plain: bool) -> list[int]:
    """Of the messages, with the EXTENDED flag; the last three of a mixed log are FD."""
    return [256 + m if plain or m < STANDARD or m >= CLASSIC else EXTENDED | 0x18FF0000 + m for m in range(MESSAGES)]


def database(plain: bool) -> str:
    lines = ['VERSION ""', "BU_: S"]
    for m, key in enumerate(identifiers(plain)):
        lines.append(f"BO_ {key} M{m}: {8 if plain or m < CLASSIC else [*FD_LENGTHS][m - CLASSIC]} S")
        lines += [f' SG_ S{m}_{s} : {16 * s}|16@1- (0.01,0) [0|0] "g" S' for s in range(SIGNALS)]
    return "\n".join(lines) + "\n"


def records(of: Any, width: int, plain: bool) -> Any:
    """Frames with the (n,) numbers of their messages, with random data, `width` bytes of them in a record."""
    from can.io.mf4 import STD_DTYPE

    fields = {name: STD_DTYPE.fields[name][0] for name in STD_DTYPE.names}
    fields["CAN_DataFrame.DataBytes"] = np.dtype(("u1", (width,)))
    keys = np.array(identifiers(plain), dtype=np.uint32)[of]
    out = np.zeros(len(of), dtype=list(fields.items()))
    out["CAN_DataFrame.BusChannel"] = 1
    out["CAN_DataFrame.ID"], out["CAN_DataFrame.IDE"] = keys & (EXTENDED - 1), keys >> 31
    lengths = np.array([8] * (MESSAGES - len(FD_LENGTHS)) + ([8] * 3 if plain else [*FD_LENGTHS]))[of]
    codes = np.array([8] * (MESSAGES - len(FD_LENGTHS)) + ([8] * 3 if plain else [*FD_LENGTHS.values()]))[of]
    out["CAN_DataFrame.DLC"], out["CAN_DataFrame.DataLength"] = codes, lengths
    out["CAN_DataFrame.EDL"] = out["CAN_DataFrame.BRS"] = codes > 8
    data = np.random.default_rng(0).integers(0, 256, (len(of), width), dtype=np.uint8)
    out["CAN_DataFrame.DataBytes"] = np.where(np.arange(width) < lengths[:, None], data, 0)
    return out


def write(path: Path, count: int, plain: bool) -> None:
    """The log."""
    from asammdf import MDF, Signal, Source

    rng = np.random.default_rng(1)
    of = rng.permuted(np.arange(count).reshape(-1, MESSAGES) % MESSAGES, axis=1).ravel()
    log, time = MDF(version="4.10"), 1e-4 * np.arange(count)
    source = Source("CAN1", "CAN1", "", Source.SOURCE_BUS, Source.BUS_TYPE_CAN)
    for width, rows in (
        (8, np.flatnonzero(of < (MESSAGES if plain else CLASSIC))),
        (64, np.flatnonzero(of >= CLASSIC)),
    ):
        if not plain or width == 8:
            frames = records(of[rows], width, plain)
            log.append(Signal(frames, time[rows], name="CAN_DataFrame", source=source))
    log.save(path, overwrite=True)
    log.close()


def by_asammdf(path: Path, dbc: Path) -> int:
    """Decoded values."""
    from asammdf import MDF

    with MDF(path) as log:
        found = log.extract_bus_logging({"CAN": [(dbc, 0)]})
        return sum(len(found.get(f"S{m}_{s}")) for m in range(MESSAGES) for s in range(SIGNALS))


def by_nineaudit(path: Path, dbc: Path) -> int:
    """Decoded values."""
    log, values = read_mdf(path), 0
    for message in load_databases([dbc]):
        payload = log.payload(log.rows_of(message.frame_id | message.is_extended_frame << 31))
        values += sum(len(decode(signal, payload)) for signal in message.signals)
    return values


def memory(path: Path) -> float:
    """Peak bytes a frame of a process that reads the log, beyond what it had before (of Linux: VmHWM and VmRSS)."""
    import asammdf  # noqa: F401  # what it takes by itself

    before = status("VmRSS")
    log = read_mdf(path)
    return (status("VmHWM") - before) * 1024 / len(log)


def status(key: str) -> int:
    """KiB, as the system has it for this process."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return int(next(line for line in lines if line.startswith(key)).split()[1])


def compare(count: int, plain: bool) -> None:
    """Generate, measure, print."""
    with tempfile.TemporaryDirectory() as folder:
        path, dbc = Path(folder) / "log.mf4", Path(folder) / "log.dbc"
        dbc.write_text(database(plain), encoding="utf-8")
        write(path, count, plain)
        took: dict[str, list[float]] = {"asammdf": [], "nineaudit": []}
        for turn in range(TURNS):
            for name, way in (("asammdf", by_asammdf), ("nineaudit", by_nineaudit)):
                start = process_time()
                values = way(path, dbc)
                took[name].append(process_time() - start)
                if turn == 0 and values != count * SIGNALS:
                    raise SystemExit(f"{name}: {values} values of {count} frames")
        command = [sys.executable, __file__, "--memory", str(path)]
        peak = float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    for name, seconds in took.items():
        print(f"{name}: {count * SIGNALS} values of {count} frames in {min(seconds):.3f} s (fastest of {TURNS} turns)")
    ratios = [a / b for a, b in zip(took["asammdf"], took["nineaudit"], strict=True)]
    fastest = min(took["asammdf"]) / min(took["nineaudit"])
    print(f"ratio {fastest:.1f}; turn by turn {min(ratios):.1f} or more, median {statistics.median(ratios):.1f}")
    print(f"asked {ASKED}; peak memory {peak:.0f} bytes a frame, asked {ASKED_MEMORY}")


def main() -> None:
    """Arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500_000, help="frames")
    parser.add_argument("--plain", action="store_true", help="classic frames only")
    parser.add_argument("--memory", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.memory:
        print(memory(arguments.memory))
    else:
        compare(max(arguments.count // MESSAGES, 1) * MESSAGES, arguments.plain)


if __name__ == "__main__":
    main()
