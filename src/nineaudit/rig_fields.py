"""What a field of a rig file may hold: units, dates, directions."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date, datetime
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field
from pydantic_core import PydanticCustomError

from nineaudit.errors import ConfigurationError
from nineaudit.identity import is_date
from nineaudit.presets import nearest
from nineaudit.units import FACTORS, Quantity, factor

FILTER_CLASSES = ("none", "CFC60", "CFC180", "CFC600", "CFC1000")
UNIT_NAMES: dict[Quantity, tuple[str, ...]] = {
    "length": tuple(FACTORS["length"]),
    "acceleration": (*FACTORS["acceleration"], "mV"),
    "angular_rate": (*FACTORS["angular_rate"], "mV"),
    "time": tuple(FACTORS["time"]),
}


def _canonical(value: str, quantity: Quantity) -> str | None:
    """The file's name of a unit that was spelled another way (``g``, ``m/s²``), or None."""
    try:
        size = factor(value, quantity)
    except ConfigurationError:
        return nearest(value, UNIT_NAMES[quantity])
    return next(name for name, known in FACTORS[quantity].items() if known == size)


def unit(quantity: Quantity) -> Callable[[str], str]:
    """The validator of a unit of a quantity: it refuses other names, and says which one is near."""

    def check(value: str) -> str:
        if value not in UNIT_NAMES[quantity]:
            close = _canonical(value, quantity)
            raise PydanticCustomError(
                "unit",
                "one of {names}",
                {
                    "names": ", ".join(UNIT_NAMES[quantity]),
                    "advice": f"did you mean {close!r}?" if close else "",
                },
            )
        return value

    return check


def _filter_class(value: str) -> str:
    for name in FILTER_CLASSES:
        if value.lower() == name.lower():
            return name
    raise PydanticCustomError("filter_class", "one of {names}", {"names": ", ".join(FILTER_CLASSES)})


def ordered(value: list[float]) -> list[float]:
    if not value[0] < value[1]:
        raise PydanticCustomError("order", "[start, end] in seconds with start before end")
    return value


def _day(value: object) -> str:
    """A date of TOML, or one in quotation marks, as YYYY-MM-DD."""
    text = value.isoformat() if isinstance(value, date) and not isinstance(value, datetime) else value
    if not isinstance(text, str) or not is_date(text):
        raise PydanticCustomError("day", "a date as YYYY-MM-DD")
    return text


def direction(value: list[float]) -> list[float]:
    if not any(value):
        raise PydanticCustomError("direction", "a vector of non-zero length")
    return value


def names(*names: str) -> dict[str, Any]:
    return {"enum": list(names)}


Text = Annotated[str, Field(min_length=1, pattern=r"^\S(.*\S)?$")]
Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Deviation = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]
LengthUnit = Annotated[str, AfterValidator(unit("length")), Field(json_schema_extra=names(*UNIT_NAMES["length"]))]
AccelerationUnit = Annotated[
    str, AfterValidator(unit("acceleration")), Field(json_schema_extra=names(*UNIT_NAMES["acceleration"]))
]
RateUnit = Annotated[
    str, AfterValidator(unit("angular_rate")), Field(json_schema_extra=names(*UNIT_NAMES["angular_rate"]))
]
TimeUnit = Annotated[str, AfterValidator(unit("time")), Field(json_schema_extra=names(*UNIT_NAMES["time"]))]
Day = Annotated[str, BeforeValidator(_day), Field(json_schema_extra={"format": "date"})]
# Case does not matter on load; the first alternative is what editors offer.
FilterClass = Annotated[
    str,
    AfterValidator(_filter_class),
    Field(
        json_schema_extra={
            "anyOf": [
                names(*FILTER_CLASSES),
                {"pattern": "^([Nn][Oo][Nn][Ee]|[Cc][Ff][Cc](60|180|600|1000))$"},
            ]
        }
    ),
]
