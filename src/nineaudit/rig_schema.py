"""The rig file's tables as pydantic models: what editors complete and what `rig check` holds a file to.

Numbers stay in the units of the file; rig.py converts them. Imported only where a rig file is read, since
pydantic is slow to load.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from nineaudit.presets import PRESETS
from nineaudit.rig_fields import (
    AccelerationUnit,
    Day,
    Deviation,
    FilterClass,
    LengthUnit,
    Positive,
    RateUnit,
    Text,
    TimeUnit,
    Vector,
    direction,
    names,
    ordered,
)  # fmt: skip


class Table(BaseModel):
    """Strict: no unknown keys, no numbers in quotation marks, no NaN or infinity."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


class RigTable(Table):
    """What the rig is."""

    model_config = ConfigDict(json_schema_extra={"dependentRequired": {"arms": ["preset"]}})
    name: Text | None = None
    """Name shown in reports. Default: the preset's title, or the file's name."""
    preset: Annotated[str, Field(json_schema_extra=names(*PRESETS))] | None = None
    """A published layout that fills in the sensors; a [[sensor]] table of the same channel overrides it."""
    arms: list[float] | None = None
    """Arm lengths of the preset, in the length unit, along x, y, z as it has them. Default: 50 mm."""


class UnitsTable(Table):
    """Units of this file's numbers, and of recordings that do not state their own."""

    length: LengthUnit = "mm"
    """Unit of positions and arms."""
    acceleration: AccelerationUnit = "g_0"
    """Unit of accelerometers: readings, range, zero, noise. mV needs a sensitivity in every sensor."""
    angular_rate: RateUnit = "rad/s"
    """Unit of rate sensors: readings, range, zero, noise. mV needs a sensitivity in every sensor."""


class RecordingTable(Table):
    """How recordings of this rig are written."""

    time: Text | None = None
    """CSV: the time column. Default: looked for by name."""
    time_unit: TimeUnit | None = None
    """Unit of the time column. Default: from the suffix of its name (time_ms), else s."""
    dbc: list[Text] = []
    """CAN databases (.dbc, .arxml, .kcd), relative to this file."""
    pre_trigger: Annotated[list[float], Field(min_length=2, max_length=2), AfterValidator(ordered)] | None = None
    """Interval [start, end] in s, body at rest: zero offset, noise, omega(0) = 0. Default: looked for."""
    filter_class: FilterClass = "none"
    """Channel frequency class of the readings as recorded; none if unfiltered. Default: none."""
    separator: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    """CSV: the field separator, one character. Default: detected."""
    decimal: Literal[".", ","] | None = None
    """CSV: the decimal mark. Default: detected."""


class TestTable(Table):
    """What all recordings of this rig have in common as tests. A recording's own header, and --test, override it."""

    number: Text | None = None
    """Number of the test."""
    title: Text | None = None
    """Title of the test."""
    item: Text | None = None
    """What is tested."""
    item_serial: Text | None = None
    """Serial number of the item."""
    date: Day | None = None
    """Date of the test, YYYY-MM-DD."""
    laboratory: Text | None = None
    """Laboratory that makes the test."""
    customer: Text | None = None
    """For whom it is made."""
    notes: Text | None = None
    """Anything else that the report is to say of the test."""


class UncertaintyTable(Table):
    """One standard deviation of what is not known exactly, for every sensor that does not state its own."""

    gain: Deviation | None = None
    """Sensitivity, relative. Default: 0.005."""
    zero: Deviation | None = None
    """Zero offset, in the sensor's unit. Default: 0.1 g_0 for accelerometers, 0.1 rad/s for rate sensors."""
    zero_rate: Deviation | None = None
    """Zero offset of rate sensors, in the angular-rate unit. Default: the number of zero."""
    alignment_deg: Deviation | None = None
    """Tilt of the sensitive axis, about each of the two axes normal to it, in degrees. Default: 0.5."""
    position: Deviation | None = None
    """Each coordinate of the position, in the length unit. Default: 0.5 mm."""
    noise: Positive | None = None
    """Noise of a reading, in the sensor's unit. Default: estimated from the quiet interval."""
    noise_rate: Positive | None = None
    """Noise of rate sensors, in the angular-rate unit. Default: the number of noise."""
    timing_s: Deviation | None = None
    """Time skew between channels, in s. Default: 1e-5."""
    resolution: Positive | None = None
    """Quantisation step (LSB) of accelerometers, in the acceleration unit. Default: what the recording shows."""
    resolution_rate: Positive | None = None
    """Quantisation step (LSB) of rate sensors, in the angular-rate unit. Default: what the recording shows."""


class SensorTable(Table):
    """One channel. Of a preset's channel, only what differs needs to be stated."""

    channel: Text
    """Name of the channel, unique in the rig."""
    kind: Literal["accelerometer", "gyroscope"] | None = None
    """Either accelerometer or gyroscope."""
    position: Vector | None = None
    """Position in the body frame, in the length unit. Needed for accelerometers; else without effect."""
    axis: Annotated[Vector, AfterValidator(direction)] | None = None
    """Sensitive axis in the body frame; any length but zero, normalised on load."""
    range: Positive | None = None
    """Full scale, in the sensor's unit: where clipping is expected."""
    signal: Text | None = None
    """CSV: column; CAN: Message.Signal; MCAP: /topic:field.path. Default: the channel's name."""
    serial: Text | None = None
    """Serial number."""
    sensitivity: Positive | None = None
    """mV per g_0 (accelerometers) or mV per deg/s (rate sensors); needed where the unit is mV."""
    scale: Positive | None = None
    """Calibrated sensitivity: reading over true value, both in the sensor's unit. Default: 1."""
    offset: float | None = None
    """Calibrated reading at a true value of 0, in the sensor's unit: true = (reading - offset) / scale. Default: 0."""
    gain: Deviation | None = None
    """Standard uncertainty of the sensitivity, relative."""
    zero: Deviation | None = None
    """Standard uncertainty of the zero offset, in the sensor's unit."""
    alignment_deg: Deviation | None = None
    """Standard uncertainty of the axis, about each of the two axes normal to it, in degrees."""
    position_u: Deviation | None = None
    """Standard uncertainty of each coordinate of the position, in the length unit."""
    noise: Positive | None = None
    """Standard deviation of the noise, in the sensor's unit."""
    timing_s: Deviation | None = None
    """Standard uncertainty of the time skew, in s."""
    resolution: Positive | None = None
    """Quantisation step (LSB) of the readings, in the sensor's unit."""


class PointTable(Table):
    """A point of the body at which results are wanted."""

    name: Text
    """Name shown in reports, unique in the rig."""
    position: Vector
    """Position in the body frame, in the length unit."""


class PartTable(Table):
    """One file of a recording that has several, each with a clock of its own."""

    file: Text
    """Pattern of its name, such as {name}_acc.csv; what stands for {name} is the same in all files of a recording."""
    channels: Annotated[list[Text], Field(min_length=1)]
    """Channels that are in this file. Each channel of the rig is in one part."""
    time: Text | None = None
    """The time column of this file. Default: that of [recording]."""
    time_unit: TimeUnit | None = None
    """Unit of the time column of this file. Default: that of [recording]."""
    offset_s: float | None = None
    """Seconds to add to its time stamps. Default: 0, the stamps are taken at their word."""
    offset_u_s: Deviation | None = None
    """Standard uncertainty of its clock against that of the first part, in s. Default: 0."""
    align: Literal["stamps", "correlation"] = "stamps"
    """Either stamps, or correlation: find the offset from readings of the same kind in the first part."""


_SENSOR_NEEDS: dict[str, Any] = {
    "required": ["kind", "axis"],
    "if": {"properties": {"kind": {"const": "accelerometer"}}},
    "then": {"required": ["position"]},
}


class RigFile(Table):
    """Rig file of nineaudit."""

    model_config = ConfigDict(
        json_schema_extra={
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "$comment": "Without a preset every sensor states its kind, axis and position.",
            "if": {"required": ["rig"], "properties": {"rig": {"required": ["preset"]}}},
            "else": {
                "required": ["sensor"],
                "properties": {"sensor": {"minItems": 1, "items": _SENSOR_NEEDS}},
            },
        }
    )
    rig: RigTable = RigTable()
    units: UnitsTable = UnitsTable()
    recording: RecordingTable = RecordingTable()
    test: TestTable = TestTable()
    uncertainty: UncertaintyTable = UncertaintyTable()
    sensor: list[SensorTable] = []
    """The channels, in the order of the array."""
    part: list[PartTable] = []
    """The files of a recording, where it has several. The clock of the first is that of the recording."""
    point: list[PointTable] = []
    """Points of the body at which results are wanted besides the origin."""
