"""Where readers, assemble and rules meet: CAN logs with next to nothing in them, and numbers at the ends of a range.

Every one ends in findings or one of our errors, without a warning of numpy (warnings are errors in tests).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from nineaudit.auditing import audit
from nineaudit.errors import RecordingError
from nineaudit.finding import Verdict
from nineaudit.readers import read
from nineaudit.readers.can import reader as can_log
from nineaudit.readers.can.frames import ERROR, FD, REMOTE, Frames, frames
from nineaudit.rig import Rig, parse_rig

DBC = """VERSION ""
NS_ :
BS_:
BU_: S
BO_ 16 IMU: 8 S
 SG_ A : 0|16@1- (0.01,0) [0|0] "m/s^2" S
 SG_ B : 32|32@1- (1,0) [0|0] "m/s^2" S
BO_ 17 BIG: 64 S
 SG_ C : 448|64@1+ (1,0) [0|0] "m/s^2" S
 SG_ D : 0|64@1- (1,0) [0|0] "m/s^2" S
 SG_ CRC : 504|8@1+ (1,0) [0|255] "" S
BO_ 19 MUX: 8 S
 SG_ P M : 0|8@1+ (1,0) [0|255] "" S
 SG_ E m1 : 8|16@1- (1,0) [0|0] "m/s^2" S
 SG_ SEQ_CNT m2 : 8|8@1+ (1,0) [0|0] "" S
BO_ 2566834709 J: 8 S
 SG_ F : 0|64@1- (1,0) [0|0] "m/s^2" S
VAL_ 17 C 18446744073709551615 "SNA" ;
VAL_ 17 D 9223372036854775807 "SNA" -9223372036854775808 "invalid" ;
SIG_VALTYPE_ 16 B : 1;
SIG_VALTYPE_ 2566834709 F : 2;
"""
N = 50
J = 2566834709
EVENLY = np.arange(N, dtype=np.int64) * 10**7
ONES = np.full((N, 64), 255, dtype=np.uint8)


def rig(*signals: str) -> Rig:
    sensors = "".join(
        f'[[sensor]]\nchannel="c{k}"\nkind="accelerometer"\nposition=[{k},0,0]\naxis=[1,0,0]\nsignal="{signal}"\n'
        for k, signal in enumerate(signals)
    )
    return parse_rig(f'[rig]\nname="seams"\n[units]\nacceleration="m/s^2"\n{sensors}')


def log(
    n: int = N, *, key: Any = 16, time: Any = None, length: Any = 8, kind: Any = 0, bus: Any = 0, data: Any = None
) -> Frames:
    """n frames, all bytes random unless `data` (n,8) or (n,64) says otherwise."""
    made = np.random.default_rng(4).integers(0, 256, (n, 8), dtype=np.uint8) if data is None else data
    long = {"long_rows": np.arange(n), "long": made} if made.shape[1] == 64 else {}
    columns = (np.broadcast_to(x, n) for x in (key, bus, kind, length))
    return frames(EVENLY[:n] if time is None else time, *columns, made[:, :8].copy(), buses=("1", "2"), **long)


class Case(NamedTuple):
    log: Frames
    signals: tuple[str, ...]
    says: tuple[str, ...]
    """Parts of the error, or of findings: all of them must be there."""


COUNTED = np.zeros((N, 8), dtype=np.uint8)
COUNTED[:, 0], COUNTED[:, 1] = np.arange(N) % 2 + 1, np.arange(N)
CODES = np.random.default_rng(5).integers(0, 128, (N, 64), dtype=np.uint8)
CODES[7, 56:] = 255
CODES[8, :8], CODES[9, :8] = [255] * 7 + [127], [0] * 7 + [128]
SMALL = np.zeros((N, 8), dtype=np.uint8)
SMALL[:, 0] = np.arange(N) % 7

ERRORS = {
    "no frames": Case(log(0), ("IMU.A",), ("no CAN frames in this log",)),
    "one frame": Case(log(1), ("IMU.A",), ("too few samples; found '1 with",)),
    "error frames only": Case(log(key=0, kind=ERROR), ("IMU.A",), ("no frame of message IMU", "error frames")),
    "remote frames only": Case(log(kind=REMOTE), ("IMU.A",), ("no frame of message IMU",)),
    "one of two messages": Case(log(), ("IMU.A", "MUX.E"), ("'c1': no frame of message MUX",)),
    "all at one time": Case(log(time=EVENLY * 0), ("IMU.A",), ("too few samples; found '1 with",)),
    "only backward": Case(log(time=-EVENLY), ("IMU.A",), ("too few samples; found '1 with",)),
    "multiplexed, never sent": Case(
        log(key=19, data=SMALL * 0), ("MUX.E",), ("no frame of message MUX carries E", "frames in which P is 1")
    ),
    "another source address": Case(
        log(key=(J & ~0xFF) | 0x33), ("J.F",), ("no frame of message J", "PGN 0xFECA) are there: 0x18FECA33")
    ),
    "another destination": Case(
        log(key=np.repeat([0x98EF1122, 0x98EA1122], N // 2)), ("J.F",), ("no frame of message J", "? 0x18EF1122")
    ),
    "29 bits where 11 are stated": Case(
        log(key=16 | 1 << 31), ("IMU.A",), ("with 29 bits are there: the database states 11",)
    ),
    "a single sample beside": Case(
        log(key=np.r_[np.full(N - 1, 16), 17]), ("IMU.A", "BIG.D"), ("c1", "a single sample, at 0.49 s")
    ),
}
FINDINGS = {
    "NaN in every frame": Case(log(data=ONES[:, :8]), ("IMU.B",), ("50 not decodable", "missing part")),
    "all too short": Case(log(length=0), ("IMU.A",), ("50 too short", "missing part of the samples 1")),
    "64 bytes stated, 8 sent": Case(log(key=17), ("BIG.C", "BIG.D"), ("50 shorter than 64 bytes",)),
    "codes of 64 bits": Case(
        log(key=17, kind=FD, length=64, data=CODES),
        ("BIG.C", "BIG.D"),
        ("D has no value in 2, C has no value in 1; in all 3 samples",),
    ),
    "random doubles": Case(log(key=J), ("J.F",), ("missing part",)),
    "multiplexed": Case(log(key=19, data=COUNTED), ("MUX.E",), ()),
    "multiplexed, too short to say": Case(log(key=19, length=0), ("MUX.E",), ("50 too short",)),
    "in pairs": Case(log(time=np.repeat(EVENLY[: N // 2], 2)), ("IMU.A",), ("25 repeated and 0 backward",)),
    "before 1970": Case(log(time=EVENLY - 10**18), ("IMU.A",), ()),
    "until 2262": Case(log(time=EVENLY + (2**63 - 10**9)), ("IMU.A",), ()),
    "a gap of centuries": Case(
        log(time=np.r_[EVENLY[:-1], 2**63 - 1]), ("IMU.A",), ("1 gap, about 922337203636 samples lost",)
    ),
    "a restart": Case(log(time=np.r_[EVENLY[:25], EVENLY[:25]]), ("IMU.A",), ("back, first to 0 s, 1 step",)),
    "every nanosecond": Case(log(time=np.arange(N)), ("IMU.A",), ()),
    "two buses": Case(log(bus=np.arange(N) % 2, data=SMALL), ("IMU.A",), ()),
    "nothing ever changes": Case(log(data=SMALL * 0), ("IMU.A", "IMU.B"), ("all 50 frames are equal", "1 message >")),
}  # fmt: skip


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    def attempt(case: Case) -> Any:
        path, dbc = tmp_path / "made.blf", tmp_path / "made.dbc"
        path.write_bytes(b"LOGG")
        dbc.write_text(DBC)
        monkeypatch.setattr(can_log, "FRAME_READERS", {".blf": lambda _: case.log})
        return read(path, rig(*case.signals), dbc=[dbc])

    return attempt


@pytest.mark.parametrize("name", ERRORS)
def test_a_log_without_what_is_asked_for_says_so(name: str, reader: Any) -> None:
    with pytest.raises(RecordingError) as caught:
        reader(ERRORS[name])
    assert all(text in str(caught.value) for text in ERRORS[name].says), caught.value
    assert "None" not in str(caught.value)


@pytest.mark.parametrize("name", FINDINGS)
def test_a_log_of_odd_numbers_is_audited(name: str, reader: Any) -> None:
    found = reader(FINDINGS[name])
    reasons = "\n".join(finding.reason for finding in audit(found).findings)
    assert all(text in reasons for text in FINDINGS[name].says), reasons
    assert (np.diff(found.time) > 0).all()
    assert len(found.native) == len(FINDINGS[name].signals)


def test_a_copy_on_another_bus_is_told_apart(reader: Any) -> None:
    """The rig takes the message from the bus that has most of it: that its copy stands still does not matter to it."""
    bus = np.r_[np.zeros(30), np.ones(20)].astype(int)
    copied = log(bus=bus, time=np.r_[EVENLY[:30], EVENLY[:20]], data=np.where(bus[:, None] == 1, 7, SMALL).astype("u1"))
    found = reader(Case(copied, ("IMU.A",), ()))
    assert [(x.bus, x.used, x.constant) for x in found.bus.identifiers] == [("1", True, False), ("2", False, True)]
    verdicts = {f.rule: f.verdict for f in audit(found).findings}
    assert verdicts["CB111"] is Verdict.PASS
    turned = reader(Case(log(bus=1 - bus, data=SMALL * 0, time=copied.time), ("IMU.A",), ()))
    assert any("0x10 IMU on bus 2: all 30 frames are equal" in f.reason for f in audit(turned).findings)
