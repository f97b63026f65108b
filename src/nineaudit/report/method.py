"""The method as text, ready to be pasted into a test report, with its references: what was done in this audit only."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nineaudit.report import mended
from nineaudit.report.numbers import NO_BREAK, digits, quantity, seconds, sensor_edge
from nineaudit.units import counted

if TYPE_CHECKING:
    from nineaudit.auditing import Audit

_ALWAYS = (
    "JCGM 100:2008, Evaluation of measurement data: Guide to the expression of uncertainty in measurement (GUM).",
    "JCGM 106:2012, Evaluation of measurement data: The role of measurement uncertainty in conformity assessment.",
    "SAE J211-1, Instrumentation for impact test, part 1: electronic instrumentation. ISO 6487, Road vehicles: "
    "measurement techniques in impact tests, instrumentation.",
)
_DRAWS = "JCGM 101:2008, Propagation of distributions using a Monte Carlo method."
_NAAP = (
    "Padgaonkar A. J., Krieger K. W., King A. I. (1975), Measurement of angular acceleration of a rigid body using "
    "linear accelerometers. Journal of Applied Mechanics 42(3).",
    "Takhounts E. G., Hasija V., Eppinger R. H. (2009), Analysis of 3D rigid body motion using the nine accelerometer "
    "array and the randomly distributed in-plane accelerometer systems. ESV paper 09-0402.",
)


def paragraphs(audit: Audit) -> list[str]:
    """The method in a few sentences each: recording, zero, rules, diagnosis, reconstruction, uncertainty."""
    said = [_recording(audit), _zero(audit), _rules(audit), _diagnosis(audit), _rebuilt(audit), _uncertainty(audit)]
    return [text.replace(NO_BREAK, " ") for text in said if text]


def references(audit: Audit) -> list[str]:
    """What the paragraphs rest on."""
    return [*_ALWAYS, *((_DRAWS,) if audit.impact else ()), *(() if audit.constraints is None else _NAAP)]


def _recording(audit: Audit) -> str:
    recording = audit.recording
    kinds = [sensor.kind for sensor in recording.rig.array.sensors]
    rates = kinds.count("gyroscope")
    sensors = f"{kinds.count('accelerometer')} accelerometers" + (
        f" and {counted(rates, 'rate sensor')}" if rates else ""
    )
    return (
        f"The recording {recording.source.path.name} (SHA-256 {recording.source.sha256}), {sensors} of the rig "
        f"“{recording.rig.name}”, {len(recording.time)} samples at {quantity(recording.rate, 'Hz', 5)}, filter class "
        f"{recording.rig.filter_class}, was audited with nineaudit {audit.tool.get('version', '')}. The recording was "
        "read only."
    )


def _zero(audit: Audit) -> str:
    if audit.rest is None:
        return "No zero was taken off, for the recording has no quiet interval."
    start, end = (seconds(t) for t in audit.rest)
    return f"The zero of each channel, its mean from {start} to {end} before the event, was taken off."


def _rules(audit: Audit) -> str:
    return (
        f"The recording was held against {counted(len(audit.rulebook.rules), 'rule')} (SHA-256 of the rules "
        f"{audit.rulebook.sha256}). A value conforms below its limit less the expanded uncertainty U (k = 2), fails "
        "above the limit plus U, and is inconclusive between them (JCGM 106, guard band on both sides)."
    )


def _diagnosis(audit: Audit) -> str:
    if not audit.diagnosis.smallest_detectable:
        return f"Diagnosis: {audit.diagnosis.reason}."
    sizes = [
        (size / sensor_edge(audit.recording.rig.array[c], audit.recording.rig)[1], c)
        for c, size in audit.diagnosis.smallest_detectable.items()
        if audit.recording.rig.array[c].kind == "accelerometer"
    ]
    told = ""
    if sizes:
        size, channel = max(sizes)
        unit, _ = sensor_edge(audit.recording.rig.array[channel], audit.recording.rig)
        told = f" A lasting shift of {quantity(size, unit, 2)} would have been noticed in any accelerometer."
    return (
        "A rigid motion and the calibration errors of all channels (gain, zero, alignment, position, timing), with the "
        "standard uncertainties of the rig file as prior, were fitted together to the whole record (maximum a "
        "posteriori, Gauss–Newton). The fit was repeated with each channel left out and with each kind of fault in it, "
        f"and the hypotheses were compared by their posterior probability.{told}"
    )


def _rebuilt(audit: Audit) -> str:
    new = audit.reconstruction
    if new is None:
        return ""
    unit, one = sensor_edge(audit.recording.rig.array[new.channels[0]], audit.recording.rig)
    return (
        f"Repair: {mended.done(new)} ({new.method}; {mended.words(new)['donors'].lower()} "
        f"{', '.join(new.donors)}), with a standard uncertainty of {quantity(float(new.u_rms) / one, unit, 2)} (rms). "
        "The original recording is not altered."
    )


def _uncertainty(audit: Audit) -> str:
    found = audit.budget
    if found is None:
        return ""
    part = digits(200.0 * found.total / found.peak, 2) if found.peak > 0 else digits(None)
    return (
        f"The expanded uncertainty (k = 2) of the peak of the angular acceleration, {part} % of it, is the root sum of "
        "squares of gain, zero, alignment, position, timing, noise, quantisation, filter mismatch and integration "
        "(GUM 5.1.2)."
    )
