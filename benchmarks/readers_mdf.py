"""MF4: raw frames to decoded signals, against asammdf's own extract_bus_logging, in one run on one file.

python benchmarks/readers_mdf.py --count 500000
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from nineaudit.can_bits import decode
from nineaudit.can_database import load_databases
from nineaudit.readers.can.mdf import read_mdf

ASKED = 2.5
MESSAGES, SIGNALS = 20, 4
DBC = 'VERSION ""\nBU_: S\n' + "".join(
    f"BO_ {256 + m} M{m}: 8 S\n"
    + "".join(f' SG_ S{m}_{s} : {16 * s}|16@1- (0.01,0) [0|0] "g" S\n' for s in range(SIGNALS))
    for m in range(MESSAGES)
)


def write(path: Path, count: int) -> None:
    """`count` frames of random data at 10 kHz, as ASAM bus logging has them."""
    from asammdf import MDF, Signal, Source
    from can.io.mf4 import STD_DTYPE

    rng = np.random.default_rng(0)
    fields = {name: STD_DTYPE.fields[name][0] for name in STD_DTYPE.names}
    classic = {**fields, "CAN_DataFrame.DataBytes": np.dtype(("u1", (8,)))}
    frames = np.zeros(count, dtype=list(classic.items()))
    frames["CAN_DataFrame.BusChannel"] = 1
    frames["CAN_DataFrame.ID"] = 256 + np.arange(count) % MESSAGES
    frames["CAN_DataFrame.DLC"] = frames["CAN_DataFrame.DataLength"] = 8
    frames["CAN_DataFrame.DataBytes"] = rng.integers(0, 256, (count, 8))
    log = MDF(version="4.10")
    source = Source("CAN1", "CAN1", "", Source.SOURCE_BUS, Source.BUS_TYPE_CAN)
    log.append(Signal(frames, 1e-4 * np.arange(count), name="CAN_DataFrame", source=source))
    log.save(path, overwrite=True)
    log.close()


def by_asammdf(path: Path, dbc: Path) -> int:
    from asammdf import MDF

    with MDF(path) as log:
        found = log.extract_bus_logging({"CAN": [(dbc, 0)]})
        return sum(len(found.get(f"S{m}_{s}")) for m in range(MESSAGES) for s in range(SIGNALS))


def by_nineaudit(path: Path, dbc: Path) -> int:
    log, values = read_mdf(path), 0
    for message in load_databases([dbc]):
        payload = log.payload(log.rows_of(message.frame_id))
        values += sum(len(decode(signal, payload)) for signal in message.signals)
    return values


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500_000, help="frames")
    count = parser.parse_args().count
    with tempfile.TemporaryDirectory() as folder:
        path, dbc = Path(folder) / "log.mf4", Path(folder) / "log.dbc"
        dbc.write_text(DBC, encoding="utf-8")
        write(path, count)
        took = {}
        for name, way in (("asammdf", by_asammdf), ("nineaudit", by_nineaudit)):
            start = time.perf_counter()
            values = way(path, dbc)
            took[name] = time.perf_counter() - start
            print(f"{name}: {values} values of {count} frames in {took[name]:.2f} s")
    print(f"ratio {took['asammdf'] / took['nineaudit']:.1f}, asked {ASKED}")


if __name__ == "__main__":
    main()
