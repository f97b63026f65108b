"""Calibration of the sensors of a rig from runs with a known input [Becker75]: rate table, flips, staircase.

Reading order: sheet.py (the CSV file of the runs), inputs.py (what each sensor felt in them), fit.py (sensitivity
vector and offset by least squares), path.py (gain and offset of a recording path), rig_text.py (the rig file with the
results in it), table.py (what is printed).

A sensor's reading v, in the unit of the rig, is S·f + V. Its sensitivity vector S has the length `scale` and the
direction `axis`; f is the specific force (or the angular rate) at the sensor in the same unit, body frame. So

    n·f = (v − V)/scale
"""
