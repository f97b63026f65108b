"""Tables: a column of time and one for each channel. Readings that are not valid are empty cells."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nineaudit.array import FloatArray
from nineaudit.recording import Recording
from nineaudit.signals import in_unit, time_unit
from nineaudit.units import factor
from nineaudit.writers.outcome import Outcome

if TYPE_CHECKING:
    from nineaudit.rig import Rig

TIME = "time_s"  # where the rig names no time column


def write_csv(recording: Recording, readings: FloatArray, path: Path, _: Sequence[Path]) -> Outcome:
    """Text table in UTF-8. Numbers have as many digits as it takes to read the same number back."""
    rig = recording.rig
    separator = rig.separator or {".tsv": "\t"}.get(path.suffix.lower(), ",")
    names, columns = _columns(recording, readings)
    cells = [_cells(column, rig) for column in columns]
    with path.open("x", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, delimiter=separator, lineterminator="\n")
        writer.writerow(names)
        writer.writerows(zip(*cells, strict=True))
    return Outcome()


def _cells(column: FloatArray, rig: Rig) -> list[str]:
    text = ["" if value != value else repr(value) for value in column.tolist()]
    return [cell.replace(".", ",") for cell in text] if rig.decimal == "," else text


def write_parquet(recording: Recording, readings: FloatArray, path: Path, _: Sequence[Path]) -> Outcome:
    """Columns of doubles, null where not valid."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    names, columns = _columns(recording, readings)
    arrays = []
    for column in columns:  # from buffers: pa.array() imports pandas
        present = np.packbits(~np.isnan(column), bitorder="little")
        buffers = [pa.py_buffer(present.tobytes()), pa.py_buffer(column.tobytes())]
        arrays.append(pa.Array.from_buffers(pa.float64(), column.size, buffers))
    with path.open("xb") as file:
        pq.write_table(pa.table(arrays, names=names), file, write_page_checksum=True)
    return Outcome()


def _columns(recording: Recording, readings: FloatArray) -> tuple[list[str], list[FloatArray]]:
    """Names and numbers of the columns, time first, in the rig's units. A signal of two channels is one column."""
    rig = recording.rig
    name = rig.time_signal or TIME
    columns = {name: in_unit(recording.time, factor(time_unit(name, rig.time_unit) or "s", "time"))}
    for sensor, column in zip(rig.array.sensors, readings.T, strict=True):
        columns[sensor.signal] = in_unit(column, sensor.to_si, sensor.offset)
    return list(columns), list(columns.values())
