"""Which recordings of a campaign count, and what its rigs and sensors are called."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import nineaudit as na
from health_entries import AXES, POSITIONS, SERIALS, Entry, entry
from nineaudit.campaign.health.assess import Health, State, assess
from nineaudit.campaign.health.identity import of_rig_file
from nineaudit.campaign.health.page import section
from nineaudit.campaign.health.records import read_records
from nineaudit.campaign.health.rig_file import improved
from nineaudit.campaign.health.words import document, text_table
from nineaudit.campaign.task import audit_one
from nineaudit.commands import simulated
from nineaudit.identity import stated
from nineaudit.repair import repair
from nineaudit.report.machine import result_document
from nineaudit.rig import parse_rig, preset_text
from nineaudit.simulate import simulate
from nineaudit.writers import write_recording

TRIAX = ("4711", "4711", "4711", "S3", "S4", "S5")


def levels(found: Health) -> dict[str, tuple[float, float]]:
    return {m.name: m.level["gain"] for m in found.sensors}


def accused(found: Health) -> dict[str, State]:
    return {m.name: m.state for m in (*found.sensors, *found.seats) if m.deviations}


def noted(found: Health, said: str) -> str:
    (note,) = [note for note in found.notes if said in note]
    return note


def test_a_recording_under_several_names_counts_once() -> None:
    """Run as data/ and as /abs/data/, the second time without dates: levels and U are those of one run."""
    once = [entry(i, {(2, "gain"): 0.004}) for i in range(12)]
    again = [entry(i, {(2, "gain"): 0.004}, uri=f"/abs/T{i:03d}.csv") | {"test": {}} for i in range(12)]
    twice = assess([*again, *once])
    assert levels(twice) == levels(assess(once))
    assert twice.tests == 12
    note = noted(twice, "their readings are counted already: 12 recordings: ")
    assert "/abs/T000.csv (the bytes of T000.csv), " in note
    assert note.endswith(" and 7 more")


def test_one_recording_counts_for_the_channels_of_each_rig() -> None:
    """A log that holds head and chest is the recording of both; the head under another name of its rig is the head."""
    head, chest = entry(1, {}), entry(1, {}, rig="chest", uri="T001.csv#chest", serials=[f"C{c}" for c in range(6)])
    block = chest["result"]["sensors"]
    for channel in block["channels"]:
        channel["channel"] = channel["channel"].replace("a", "c")
    block["information"]["parameters"] = [[c.replace("a", "c"), p] for c, p in block["information"]["parameters"]]
    renamed = entry(1, {}, rig="head 1", uri="archive/T001.csv")
    assert [r.uri for r in read_records([renamed, chest, head]).records] == ["T001.csv", "T001.csv#chest"]


def test_recordings_of_several_files_are_the_same_where_all_files_are() -> None:
    def parts(*names: str) -> dict[str, Any]:
        return {"parts": [{"sha256": name * 64} for name in names], "sha256": names[0] * 64}

    whole, first = entry(1, {}, recording=parts("a", "b")), entry(2, {}, recording=parts("a", "c"))
    kept = read_records([whole, first, entry(3, {}, recording=parts("a", "b"))])
    assert [r.uri for r in kept.records] == ["T001.csv", "T002.csv"]
    made = {"reconstructed": [{"original_sha256": "a" * 64}]}  # the record of a repair names the first file
    assert [r.uri for r in read_records([whole, entry(4, {}, recording=made)]).records] == ["T001.csv"]


def test_the_same_test_in_other_bytes_is_told() -> None:
    """CSV and MCAP of one test: nobody knows that they are one."""
    test = {"number": "T1", "date": "2026-03-01"}
    found = assess([entry(1, {}, test=test, uri="T1.csv"), entry(2, {}, test=test, uri="T1.mcap"), entry(3, {})])
    assert found.tests == 3
    assert "T1, 2026-03-01, head (T1.csv, T1.mcap)" in noted(found, "of the same test, rig and date")
    assert "T1.mcap" in text_table(found)
    other = [entry(1, {}, test=test), entry(2, {}, test=test, rig="chest"), entry(3, {}, test=test | {"number": "T2"})]
    assert not any("of the same test" in note for note in assess(other).notes)


def test_a_repaired_copy_is_dropped_where_its_original_tells(tmp_path: Path) -> None:
    """Audited for real: the record of the repair leads to the original, and a copy of it in another folder is it."""
    text = preset_text("naap-3222")
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    recording = simulated(parse_rig(text), "general", ["a1y:gain=0.2"], seed=3)
    write_recording(recording, tmp_path / "T1.csv")
    (tmp_path / "moved").mkdir()
    (tmp_path / "moved" / "T1.csv").write_bytes((tmp_path / "T1.csv").read_bytes())
    audit = na.audit(na.read(tmp_path / "T1.csv", parse_rig(text)))
    repair(audit, tmp_path / "T1r.csv", channel="a1y", now=datetime(2026, 3, 1, tzinfo=UTC))
    uris = [str(tmp_path / name) for name in ("T1r.csv", "moved/T1.csv", "T1.csv")]
    entries = [audit_one(uri, tmp_path / "rig.toml") for uri in uris]
    known = read_records(entries)
    assert [r.uri for r in known.records] == [uris[2]]
    (note,) = [note for note in known.notes if "counted already: 2 recordings" in note]
    assert f"{uris[0]} (repaired, the readings of {uris[2]})" in note
    alone = read_records(entries[:1])  # nothing else tells of these readings
    assert [r.uri for r in alone.records] == [uris[0]]


def test_one_axis_of_a_triaxial_sensor_is_named() -> None:
    found = assess([entry(i, {(1, "gain"): 0.02 * (i >= 30)}, serials=TRIAX) for i in range(60)])
    assert accused(found) == {"4711 accelerometer 2": State.RECALIBRATE}
    (member,) = [m for m in found.sensors if m.deviations]
    assert abs(member.deviations[0].value - 0.02) < member.deviations[0].U < 0.002
    assert member.seats == (("head", "a1"),)
    assert noted(found, "on several channels").endswith(": 4711")
    assert "4711 accelerometer 2 (a1 of head): gain +" in text_table(found)
    assert {s["serial"] for s in document(found)["sensors"]} == {"4711", "S3", "S4", "S5"}
    charts = section(found).charts
    assert charts[1].title.startswith("Gain of 4711 accelerometer 2 (a1 of head)")
    assert "4711 acce… 2" in [name for _, name in charts[0].across]


def test_the_scale_of_one_axis_of_a_triaxial_sensor_is_written_back() -> None:
    """And of that axis alone, in the rig of its item."""
    tests = [
        entry(i, {(1, "gain"): 0.02 * (item == "B")}, serials=TRIAX if item == "B" else SERIALS, test=stands)
        for i in range(40)
        for item in ("AB"[i % 2],)
        for stands in ({"item_serial": item},)
    ]
    text = '[rig]\nname = "head"\n[test]\nitem_serial = "B"\n[units]\nacceleration = "m/s^2"\n'
    text += "[uncertainty]\ngain = 0.005\n"
    for c in range(6):
        place = [1000 * x for x in POSITIONS[c]]
        text += f'[[sensor]]\nchannel = "a{c}"\nkind = "accelerometer"\nserial = "{TRIAX[c]}"\nscale = 1.0\n'
        text += f"position = {place}\naxis = {list(AXES[c])}\n"
    changes, told = improved(assess(tests), parse_rig(text))
    assert [one.sensor for one in told][:4] == [*(f"4711 accelerometer {i}" for i in (1, 2, 3)), "S3"]
    assert {c for c, keys in changes.items() if "scale" in keys} == {"a1"}
    assert changes["a1"]["scale"] == pytest.approx(1.02, abs=2e-3)


def test_an_accelerometer_and_a_gyroscope_of_one_serial_number_are_two() -> None:
    kinds = ("accelerometer",) * 3 + ("gyroscope",) + ("accelerometer",) * 2
    serials = ("IMU1", "S1", "S2", "IMU1", "S4", "S5")
    tests = [entry(i, {(3, "gain"): 0.02 * (i >= 30)}, serials=serials, kinds=kinds) for i in range(60)]
    assert accused(assess(tests)) == {"IMU1 gyroscope": State.RECALIBRATE}
    known = read_records(tests)
    assert {known.records[0].shock["IMU1 accelerometer"], known.records[0].shock["IMU1 gyroscope"]} == {1000.0, 1300.0}
    assert known.serials["IMU1 gyroscope"] == "IMU1"


def test_axes_of_a_triaxial_sensor_may_be_stated_with_scales_of_their_own() -> None:
    found = assess([entry(i, {}, serials=TRIAX, scale=(1.0, 1.03, 0.98, 1, 1, 1)) for i in range(30)])
    assert all(abs(value) < 0.002 for value, _ in levels(found).values())


def test_a_name_is_the_same_wherever_the_sensor_is() -> None:
    """One recording has the block on three channels: elsewhere too its axes are counted, and where only one of them is
    there, nobody knows which that is."""
    one_axis = ("4711", "S1", "S2", "S3", "S4", "S5")
    known = read_records([entry(1, {}, serials=TRIAX), entry(2, {}, serials=one_axis, rig="other")])
    assert [row.sensor for row in known.records[0].rows][:4] == [*(f"4711 accelerometer {i}" for i in (1, 2, 3)), "S3"]
    assert known.records[1].rows[0].sensor == "4711 accelerometer 1 of 1"


def two_dummies(items: tuple[str, str], serials: tuple[str, str], **changes: Any) -> list[Entry]:
    """The array of one preset in dummy A until the 30th test, then in B, with other errors."""
    rng = np.random.default_rng(3)
    size = {"gain": 0.005, "position_x": 5e-4}
    theta = [{(c, p): u * rng.standard_normal() for c in range(6) for p, u in size.items()} for _ in range(2)]
    return [
        entry(
            i,
            theta[which],
            rig="3-2-2-2 array",
            serials=[f"{serials[which]}{c}" if serials[which] else None for c in range(6)],
            parameters=("gain", "position_x"),
            test={"item_serial": items[which]} if items[which] else {},
            rig_sha256=f"{which}" * 64,
            **changes,
        )
        for i in range(60)
        for which in (int(i >= 30),)
    ]


@pytest.mark.parametrize("serials", [("", ""), ("A", "B")])
def test_items_divide_rigs_of_one_name(serials: tuple[str, str]) -> None:
    found = assess(two_dummies(("4711", "4712"), serials))
    assert accused(found) == {}
    assert {seat[0] for m in found.seats for seat in m.seats} == {"3-2-2-2 array [4711]", "3-2-2-2 array [4712]"}
    assert len(found.sensors) == len(found.seats) == 12
    assert not any("taken as one rig" in note for note in found.notes)


def test_tests_without_an_item_are_of_a_rig_of_their_own() -> None:
    rest = [entry(i, {}, rig="3-2-2-2 array") for i in range(60, 63)]
    found = assess([*two_dummies(("4711", "4712"), ("A", "B")), *rest])
    assert noted(found, "for want of the item's serial number").endswith(": 3-2-2-2 array")
    assert {m.tests for m in found.seats if m.seats[0][0] == "3-2-2-2 array"} <= {3}


def test_rig_files_of_one_name_are_told() -> None:
    found = assess(two_dummies(("", ""), ("A", "B")))
    assert "3-2-2-2 array (2 rig files); where they are several, name them apart" in noted(found, "taken as one rig")


def test_an_item_that_changes_with_the_tests_is_what_is_tested() -> None:
    """Helmets: the rig sits in the headform all the while."""
    found = assess([entry(i, {}, test={"item_serial": f"H{i // 3}"}) for i in range(30)])
    assert {m.name for m in found.seats} <= {f"a{c} of head" for c in range(6)}
    assert {m.tests for m in found.sensors} == {30}
    assert "head (30 tests of 10 items)" in noted(found, "taken as one rig")


def test_a_rig_file_finds_its_sensors_again() -> None:
    kinds = iter(("S0", "4711", "4711", "4711"))
    text = re.sub(r"(?m)^channel = .*$", lambda m: f'{m[0]}\nserial = "{next(kinds, "X")}"', preset_text("naap-3222"))
    rig = replace(parse_rig(text), name="3-2-2-2 array", test=stated({"item_serial": "4712"}, "rig file"))
    tests = two_dummies(("4711", "4712"), ("A", "B"))
    tests[40] = entry(40, {}, serials=TRIAX)
    called, sensors = of_rig_file(read_records(tests).names, rig)
    assert called == "3-2-2-2 array [4712]"
    assert list(sensors.values())[:4] == ["S0", *(f"4711 accelerometer {i}" for i in (1, 2, 3))]


def test_a_rig_that_leaves_no_error_open_is_told() -> None:
    """Audited for real, beside a rig that does."""
    text = preset_text("naap-3222")
    closed = text
    for name in ("gain", "alignment_deg", "position"):
        closed = re.sub(rf"(?m)^{name} = [0-9.]+", f"{name} = 0", closed)
    entries = [
        {
            "uri": f"T{i}.csv",
            "test": {"date": f"2026-03-0{i + 1}"},
            "result": result_document(na.audit(simulate(parse_rig(one), "general", seed=i, rate_hz=4000.0).recording)),
        }
        for i, one in enumerate((text, closed))
    ]
    assert entries[1]["result"]["sensors"]["information"]["parameters"] == []
    found = assess(entries)
    assert found.tests == 1
    assert "no calibration from 1 recording: its rig leaves no error open" in found.notes
    assert assess(entries[1:]).tests == 0
