"""Every scheme's own line: a colour on white, a colour on black, and a dash pattern, the same on every page.

Colours stand 3:1 or more off their ground (WCAG 2.1, 1.4.11) and apart from each other in the eyes of all: CIELAB
distance of 25 or more also for protanopes, deuteranopes and tritanopes (Machado 2009). Where there is no colour, the
dashes tell: no two are alike.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple


class Style(NamedTuple):
    """`light`: colour on the light ground and in print; `dark`: on the dark one; `dash` in pixels, "" a solid line."""

    light: str
    dark: str
    dash: str


STYLES: Final = {
    "map": Style("#5a87d2", "#4b69d2", ""),
    "optimised": Style("#0f002d", "#c3ffe1", "9 3"),
    "product-free": Style("#f05a0f", "#ffb41e", "2 2"),
    "ninacc": Style("#2d5a4b", "#5ab496", "9 3 2 3"),
    "six-accelerometers": Style("#960000", "#c32d4b", "9 3 2 3 2 3"),
    "rates": Style("#0000ff", "#3cf0ff", "5 2"),
    "periphery": Style("#870078", "#786996", "1 4"),
    "co-planar": Style("#a5875a", "#b4b45a", "14 5"),
    "compact-cube": Style("#2d0000", "#ffffa5", "5 5"),
    "rgla": Style("#5a00a5", "#960fff", "14 3 5 3"),
    "rgla-fourier": Style("#d26996", "#a55a00", "5 3 1 3"),
    "rgla-lanczos": Style("#a54bff", "#a5a5ff", "2 6"),
}
"""By the names of scheme_runs.schemes_of."""
FAMILIES: Final = (
    ("map", "optimised", "product-free", "ninacc", "six-accelerometers"),
    ("rates", "periphery", "co-planar", "compact-cube"),
    ("rgla", "rgla-fourier", "rgla-lanczos"),
)
"""Schemes to be seen over each other: of accelerometers, of rate sensors, of one derivative or another."""
MOST: Final = 5
"""Schemes over the reference in one chart."""


def css() -> str:
    """The rules of all lines, of the reference, which is broad, and of keys long enough to show a pattern."""
    light, dark = (
        "; ".join(f"--scheme-{name}: {style[ground]}" for name, style in STYLES.items()) for ground in (0, 1)
    )
    lines = [
        f":root {{ {light}; }}",
        f"@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark}; }} }}",
        *(
            f".scheme-{name} {{ --s: var(--scheme-{name}); stroke-dasharray: {style.dash or 'none'}; }}"
            for name, style in STYLES.items()
        ),
        '.line[class*="scheme-"] { stroke-width: 1.5; stroke-linecap: butt; }',
        ".line.reference { stroke-width: 3; }",
        ".legend .key { width: 60px; } .legend .key path { transform: scaleX(2.8); }",
    ]
    return "\n".join(lines) + "\n"


def groups(names: Iterable[str]) -> list[list[str]]:
    """`names` in charts of MOST at most, families together."""
    wanted = set(names)
    out: list[list[str]] = []
    for family in FAMILIES:
        there = [str(name) for name in family if name in wanted]
        if out and len(out[-1]) + len(there) <= MOST:
            out[-1] += there
        elif there:
            out.append(there)
    return out


def classes(name: str, reference: bool = False) -> str:
    """What the style sheet calls the line of a scheme."""
    return f"scheme-{name}{' reference' if reference else ''}"
