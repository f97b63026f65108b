"""What the command `motion` says of a motion, as lines of text in the rig's units. Heavy modules are imported late."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nineaudit.errors import ConfigurationError

if TYPE_CHECKING:
    from nineaudit.case import Case
    from nineaudit.motion import Kinematics, Start
    from nineaudit.rig import Rig


def summary(found: Kinematics, rig: Rig, name: str) -> list[str]:
    """What was found, in the rig's units: what makes it doubtful first, peaks, injury values with their standard
    uncertainty, and how far it went."""
    import numpy as np

    from nineaudit.report.numbers import digits, edge, quantity, spelled

    rate = (len(found.time) - 1) / (found.time[-1] - found.time[0])
    span = f"{found.time[0]:.4g} to {found.time[-1]:.4g} s, {len(found.time)} samples at {digits(float(rate))} Hz"
    lines = [f"{name}: {span}; {found.method}", *(f"  WARNING: {said}" for said in found.warnings)]
    width = max(map(len, found.values))
    for label, value in found.values.items():
        unit, one = edge(value.unit, rig)
        u = "" if value.u is None else f"  u {digits(value.u / one, 2)}"
        lines.append(f"  {label:<{width}}  {digits(value.value / one, 4)} {spelled(unit)}".rstrip() + u)
    largest = zip(("yaw", "pitch", "roll"), np.degrees(np.abs(found.euler).max(axis=0)), strict=True)
    lines.append("  largest angles: " + ", ".join(f"{axis} {angle:.3g}°" for axis, angle in largest))
    unit, one = edge("m", rig)
    for point, path in found.paths.items():
        fastest = float(np.linalg.norm(path.v, axis=1).max())
        farthest = float(np.linalg.norm(path.x - path.x[0], axis=1).max()) / one
        reach = f"{quantity(fastest, 'm/s')}, {quantity(farthest, unit)} from its start"
        lines.append(f"  {point} in the laboratory: at most {reach}")
    return [*lines, *(f"  note: {note}" for note in found.notes if note not in found.warnings)]


def worst_case_lines(case: Case, found: Kinematics, text: str | None) -> list[str]:
    """How far errors of gain of chosen channels can take ω, `text` as --worst-case has it; nothing without."""
    if text is None:
        return []
    from nineaudit import motion_six
    from nineaudit.report.numbers import digits

    channels, limit = motion_six.chosen(text, case)
    worst = motion_six.worst_case(case, found.omega[0], channels, limit)
    end, most = (", ".join(digits(value, 3) for value in values) for values in (worst.at_end, worst.at_most))
    return [
        f"six accelerometers, gains of {', '.join(channels)} off by up to {100 * limit:g} %, worst signs:",
        f"  ω x, y, z at the end by up to {end} rad/s, {100 * worst.of_peak:.1f} % of its peak; at most {most} rad/s",
    ]


def gyro_lines(case: Case, found: Kinematics, text: str | None) -> list[str]:
    """ω against the rate sensors through their response, `text` as --gyro-response has it; nothing without."""
    if text is None:
        return []
    from nineaudit import motion_six
    from nineaudit.commands import numbers
    from nineaudit.report.numbers import digits

    response = numbers(text, "--gyro-response") or []
    if len(response) != 2:
        raise ConfigurationError(
            "response of the rate sensors", place="--gyro-response", found=text, expected="HZ,ZETA such as 37,0.5"
        )
    done = motion_six.agreement(case, found.omega, *response)
    largest, rms = (", ".join(digits(value, 3) for value in values) for values in (done.largest, done.rms))
    return [
        f"ω through a response of {response[0]:g} Hz, ζ = {response[1]:g}, less the rate sensors, x, y, z:",
        f"  largest {largest} rad/s, {100 * max(done.of_peak):.2g} % of their peak; rms {rms} rad/s",
    ]


def triax_lines(case: Case, prefix: str, method: str, start: Start) -> tuple[list[str], bool]:
    """The check of an extra triax, and whether it did not fail."""
    from nineaudit.finding import Verdict
    from nineaudit.motion_triax import check_triax
    from nineaudit.report.numbers import digits

    found = check_triax(case, prefix, method, start)
    lines = [f"triax {', '.join(found.channels)} as the other channels predict it, against measured:"]
    for one in found.judged:
        expanded = "U not known" if one.U is None else f"U {digits(100 * one.U, 2)} %, k=2"
        pair = f"{digits(one.predicted, 4)} against {digits(one.measured, 4)}, {100 * one.deviation:+.2f} %"
        lines.append(f"  {one.name} {pair} ({expanded}); {100 * one.tolerance:.2f} % in the paper: {one.verdict}")
    lines.append(f"  largest difference of acceleration {100 * found.worst:.2g} % of the peak")
    return lines, all(one.verdict is not Verdict.FAIL for one in found.judged)
