"""The packages of the extra `campaign`, which an installation may be without."""

from __future__ import annotations

from importlib.util import find_spec

from nineaudit.errors import ConfigurationError


def require(*modules: str) -> None:
    """ConfigurationError where one of the modules is not installed."""
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise ConfigurationError(
            "packages are missing",
            found=", ".join(missing),
            advice="install nineaudit with the extra: nineaudit[campaign]",
        )
