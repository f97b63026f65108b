"""Published sensor layouts by name, and a rig file to start from for each.

A layout is its channel names (METHODS.md 1.1): ``a2z`` is the accelerometer at point 2 along z, ``gz`` the
rate sensor about z. Point 0 is the origin; points 1, 2, 3 lie on +x, +y, +z at the arm lengths.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Final

from nineaudit.array import Kind
from nineaudit.errors import ConfigurationError

DEFAULT_ARM: Final = 0.050
"""Arm length where the rig file states none, m."""

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class PresetSensor:
    """One channel of a layout: `position` in the unit of the arms, `axis` a unit vector."""

    channel: str
    kind: Kind
    position: Vector
    axis: Vector


@dataclass(frozen=True)
class Preset:
    """A layout: `title`, `source`, and what the rigid-body constraints can tell about it (METHODS.md 3)."""

    title: str
    source: str
    channels: tuple[str, ...]
    tells: str

    @property
    def arms(self) -> tuple[str, ...]:
        """Body axes that carry an arm, in the order of the rig file's ``arms``."""
        return tuple("xyz"[point - 1] for point in sorted({_point(c) for c in self.channels} - {0}))

    def sensors(self, arms: Sequence[float]) -> tuple[PresetSensor, ...]:
        """The channels with `arms`, one length per entry of ``self.arms``, any unit."""
        lengths = dict(zip(self.arms, arms, strict=True))
        return tuple(_sensor(channel, lengths) for channel in self.channels)


def _point(channel: str) -> int:
    """Point a channel sits at; a rate sensor reads the same everywhere and is put at the origin."""
    return 0 if channel.startswith("g") else int(channel[1])


def _unit(axis: str, length: float = 1.0) -> Vector:
    x, y, z = (length if axis == letter else 0.0 for letter in "xyz")
    return (x, y, z)


def _sensor(channel: str, lengths: Mapping[str, float]) -> PresetSensor:
    kind: Kind = "gyroscope" if channel.startswith("g") else "accelerometer"
    point = _point(channel)
    arm = "xyz"[point - 1] if point else ""
    return PresetSensor(channel, kind, _unit(arm, lengths.get(arm, 0.0)), _unit(channel[-1]))


_GYROS = ("gx", "gy", "gz")
_NAAP = ("a0x", "a0y", "a0z", "a1y", "a1z", "a2x", "a2z", "a3x", "a3y")
_CENTRE = _NAAP[:3]


def _triaxes(*points: int) -> tuple[str, ...]:
    return tuple(f"a{point}{axis}" for point in points for axis in "xyz")


_NOTHING = "as many channels as unknowns: rigid-body constraints detect no fault at all"

PRESETS: Final[Mapping[str, Preset]] = {
    "naap-3222": Preset(
        "nine accelerometers, 3-2-2-2 (NAAP, NAP)",
        "Padgaonkar 1975; Takhounts 2009",
        _NAAP,
        "pairs a2z/a3y, a3x/a1z, a1y/a2x cannot be told apart at rest, nor one of them in planar motion",
    ),
    "naap-gyro": Preset(
        "nine accelerometers, 3-2-2-2, and three rate sensors",
        "Padgaonkar 1975, with rate sensors",
        _NAAP + _GYROS,
        "every channel can be told apart, at rest and in planar and general motion",
    ),
    "triax-3": Preset(
        "three triaxial accelerometers, one on each axis",
        "Alem and Holstein 1977 (NINACC); periphery scheme of Martin 1998",
        _triaxes(1, 2, 3),
        "three pairs cannot be told apart at rest; every channel can in motion",
    ),
    "triax-4": Preset(
        "twelve accelerometers: triaxes at the centre and on each axis",
        "Alem and Holstein 1977, with a fourth triax",
        _triaxes(0, 1, 2, 3),
        "three pairs cannot be told apart at rest; every channel can in motion",
    ),
    "coplanar-3": Preset(
        "three coplanar triaxial accelerometers: origin, +x, +y",
        "co-planar scheme of Martin 1998",
        _triaxes(0, 1, 2),
        "channels normal to the plane are undetectable at rest and in rotation about the normal",
    ),
    "coplanar-3-gyro": Preset(
        "three coplanar triaxial accelerometers and three rate sensors",
        "co-planar scheme of Martin 1998, with rate sensors",
        _triaxes(0, 1, 2) + _GYROS,
        "pairs a1z/gy, a2z/gx cannot be told apart at rest; every channel can in motion",
    ),
    "6aw": Preset(
        "six accelerometers and three rate sensors (6a-omega)",
        "six-accelerometer scheme with rate sensors, METHODS.md 3",
        (*_CENTRE, "a1y", "a2z", "a3x", *_GYROS),
        "pairs a0z/a2z, a0x/a3x, a0y/a1y can never be told apart",
    ),
    "3-2-1": Preset(
        "six accelerometers, 3-2-1: origin, y arm, x arm",
        "Becker and Willems 1975",
        (*_CENTRE, "a1z", "a2x", "a2z"),
        _NOTHING,
    ),
    "rgla": Preset(
        "three rate sensors and three accelerometers at the origin (RGLA)",
        "Hu 1977",
        _CENTRE + _GYROS,
        _NOTHING,
    ),
    "compact-cube": Preset(
        "one triaxial accelerometer beside the point of interest, and three rate sensors",
        "compact cube of Martin 1998, eqs 8, 15, 16",
        _triaxes(1) + _GYROS,
        _NOTHING,
    ),
}


def nearest(name: str, known: Sequence[str]) -> str | None:
    """The known name that `name` was probably meant to be, or None."""
    folded = {k.lower(): k for k in known}
    close = get_close_matches(name.lower(), folded, n=1, cutoff=0.6)
    return folded[close[0]] if close else None


def find_preset(name: str, *, file: Path | None = None, place: str | None = None) -> Preset:
    """The layout called `name`; ConfigurationError lists the layouts and suggests the nearest."""
    if name in PRESETS:
        return PRESETS[name]
    close = nearest(name, tuple(PRESETS))
    raise ConfigurationError(
        "unknown preset",
        file=file,
        place=place,
        found=name,
        expected="one of " + ", ".join(PRESETS),
        advice=f"did you mean {close!r}?" if close else None,
    )


def check_arms(
    name: str, arms: Sequence[float], *, file: Path | None = None, place: str | None = None
) -> tuple[PresetSensor, ...]:
    """Sensors of preset `name` with `arms`; ConfigurationError where their number or sign is wrong."""
    preset = find_preset(name, file=file, place=place)
    if len(arms) != len(preset.arms) or not all(0.0 < arm < float("inf") for arm in arms):
        raise ConfigurationError(
            f"wrong arms for preset {name!r}",
            file=file,
            place=place,
            found=list(arms),
            expected=f"{len(preset.arms)} positive lengths (along: {', '.join(preset.arms) or 'no axis'})",
        )
    return preset.sensors(arms)


_TEXT = """\
# {title}
# Source: {source}.
# Diagnosis: {tells}.
# Body frame: x forward, y to the right, z down (SAE J1733).

[rig]
name = "{title}"
preset = "{name}"
{arms}
[units]                         # of this file's numbers, and of recordings that do not state theirs
length = "mm"                   # mm, cm, m, in
acceleration = "g_0"            # g_0, m/s^2, mm/s^2, ft/s^2, mV (then each sensor states its sensitivity)
angular_rate = "rad/s"          # rad/s, deg/s, mV

[recording]
time = "time_s"                 # CSV: the time column
# dbc = ["rig.dbc"]             # CAN: databases, relative to this file
pre_trigger = [-0.02, -0.001]   # seconds, body at rest; leave out to have a quiet interval looked for
filter_class = "CFC1000"        # as recorded: none, CFC60, CFC180, CFC600, CFC1000

[uncertainty]                   # one standard deviation, default of every sensor
gain = 0.005                    # relative
zero = 0.1                      # acceleration unit
{zero_rate}alignment_deg = 0.5
position = 0.5                  # length unit
noise = 0.3                     # acceleration unit; leave out to have it estimated from pre_trigger
{noise_rate}timing_s = 1e-5

# The preset places the sensors. A [[sensor]] table of the same channel overrides what it states: range (full
# scale), signal (column, Message.Signal or /topic:field; default: the channel's name), serial, position,
# axis, scale and offset (calibrated), gain, zero, alignment_deg, position_u, noise, timing_s. Other channels are added
# to the array.
{sensors}
[[point]]                       # where results are wanted besides the origin
name = "CG"
position = [10.0, 0.0, -5.0]
"""


def preset_text(name: str, arms: Sequence[float] | None = None) -> str:
    """A commented rig file that uses preset `name`, with `arms` in mm (default 50 mm each).

    Raises ConfigurationError for an unknown name, or arms of wrong number or sign.
    """
    preset = find_preset(name)
    lengths = [1e3 * DEFAULT_ARM] * len(preset.arms) if arms is None else [float(arm) for arm in arms]
    sensors = check_arms(name, lengths)
    gyros = any(s.kind == "gyroscope" for s in sensors)
    return _TEXT.format(
        name=name,
        title=preset.title,
        source=preset.source,
        tells=preset.tells,
        arms=_line(f"arms = {lengths!r}", "mm, along " + ", ".join(preset.arms)) if lengths else "",
        zero_rate=_line("zero_rate = 0.01", "angular-rate unit") if gyros else "",
        noise_rate=_line("noise_rate = 0.05", "angular-rate unit") if gyros else "",
        sensors="".join(_override(sensor) for sensor in sensors),
    )


def _line(text: str, comment: str) -> str:
    return f"{text:<31} # {comment}\n"


def _override(sensor: PresetSensor) -> str:
    full_scale, unit = (500.0, "g_0") if sensor.kind == "accelerometer" else (100.0, "rad/s")
    return f'\n[[sensor]]\nchannel = "{sensor.channel}"\n' + _line(f"range = {full_scale}", unit)
