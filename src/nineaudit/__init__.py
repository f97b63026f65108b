"""nineaudit: can the recording of a rigid-body sensor array be trusted, and if not, which channel is wrong?

Reading order: array.py (what an instrument is), physics/rigid_body.py (what it must read), physics/nap.py (the nine
accelerometers of the 3-2-2-2 layout), estimate/calibration.py (what small errors do), estimate/parity.py and
estimate/closed_form.py (what must vanish, and leave-one-out), case.py, checks/, diagnose.py, reconstruct.py,
auditing.py; then readers/ and report/ at the two ends.

Frames. Everything is in the body frame: origin and axes are those in which the rig file gives positions and axes;
SAE J1733 (x forward, y right, z down) for a head. Rotations and rates are right-handed.

Units. SI inside: m, m/s², rad/s, rad/s², s. The rig file and the recording have their own; they are converted once on
reading (rig.py, readers/clocks/assemble.py) and once on writing (writers, report). g_0 is 9.80665 m/s².

Symbols, and their names in the code:

    r_i, n_i   position (m) and unit sensitive axis of channel i          Sensor.position, Sensor.axis
    y_i        reading, the zero before the event taken off               Case.readings
    a0, α, ω   specific force at the origin, angular acceleration, rate   a0, alpha, omega
    H, N       design [n_i; r_i × n_i] and its parity rows, N H = 0       rigid_body.design, parity
    q(ω)       centripetal part of the readings                           rigid_body.centripetal
    θ          calibration errors: gain, zero, two tilts, position, time  calibration.PARAMETERS
    σ, u, U    noise sd; standard uncertainty; expanded U = k u, k = 2    Case.sigma, Measure.u
    λ          how far a fault stays visible under a rival hypothesis     closed_form.separation

    y_i = (1+g_i) n_i·(a0 + α × r_i + ω × (ω × r_i)) + b_i + noise         accelerometer
    y_i = (1+g_i) n_i·ω + b_i + noise                                      rate sensor

Sources: [Padgaonkar75] 3-2-2-2; [Becker75] SAE 751173; [Alem77] UM-HSRI-77-46; [Hu77]; [Martin98]; [Takhounts09]
ESV 09-0402; SAE J211-1, J1727, J1733; ISO 6487; JCGM 100 (GUM), 101, 106. Equations stand above the code that uses
them, with their numbers; "METHODS n.m" is the project's own derivation with the misprints of the papers put right.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nineaudit.auditing import Audit, AuditVerdict, audit
    from nineaudit.errors import ConfigurationError, EstimationError, NineauditError, RecordingError
    from nineaudit.finding import Finding, Measure, Severity, Verdict
    from nineaudit.readers import read
    from nineaudit.recording import Recording
    from nineaudit.report import write_report
    from nineaudit.rig import Rig, load_rig
    from nineaudit.rulebook import load_rulebook

_HOMES = {
    "nineaudit.auditing": ("Audit", "AuditVerdict", "audit"),
    "nineaudit.errors": ("ConfigurationError", "EstimationError", "NineauditError", "RecordingError"),
    "nineaudit.finding": ("Finding", "Measure", "Severity", "Verdict"),
    "nineaudit.readers": ("read",),
    "nineaudit.recording": ("Recording",),
    "nineaudit.report": ("write_report",),
    "nineaudit.rig": ("Rig", "load_rig"),
    "nineaudit.rulebook": ("load_rulebook",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Audit", "AuditVerdict", "ConfigurationError", "EstimationError", "Finding", "Measure", "NineauditError",
    "Recording", "RecordingError", "Rig", "Severity", "Verdict", "audit", "load_rig", "load_rulebook", "read",
    "write_report",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Public names are loaded when first used, so that ``nineaudit --help`` need not import scipy."""
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value
