"""Signs that an old code page lacks, as signs that it has: text for a terminal or file that is not Unicode."""

from __future__ import annotations

import codecs
from typing import Final

HANDLER: Final = "nineaudit.plain"
"""Name of the error handler for an encoder."""
_PLAIN: Final = {
    "≤": "<=", "≥": ">=", "≈": "~", "±": "+/-", "−": "-", "–": "-", "·": "*", "×": "x", "→": "->", "√": "sqrt",
    "²": "^2", "³": "^3", "°": " deg", "µ": "u", "μ": "u", "ω": "omega", "α": "alpha", "θ": "theta", "σ": "sigma",
    "λ": "lambda", "χ": "chi", "Σ": "sum", "⁺": "+", "…": "...", "✓": "ok", "’": "'", "“": '"', "”": '"',
    "\u00a0": " ", "\u202f": " ", "\u2009": " ",
}  # fmt: skip


def replaced(error: UnicodeError) -> tuple[str | bytes, int]:
    """What stands for the signs that cannot be encoded: a spelling of the sign, else a question mark."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(_PLAIN.get(sign, "?") for sign in error.object[error.start : error.end]), error.end


def install() -> str:
    """Make the handler known; its name."""
    codecs.register_error(HANDLER, replaced)
    return HANDLER
