"""What says that a store, a disk or an archive cannot be asked, whatever its client calls that."""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from nineaudit.errors import ConfigurationError

_OF_CLIENTS: Final = {
    "botocore.exceptions": ("BotoCoreError", "ClientError"),
    "aiohttp": ("ClientError",),
    "ftplib": ("Error",),
}
"""What clients of stores raise that is no OSError."""


def store_errors() -> tuple[type[Exception], ...]:
    """What says that a place cannot be opened, reached or read, as of now: clients are loaded when they are needed."""
    loaded = [(sys.modules[module], names) for module, names in _OF_CLIENTS.items() if module in sys.modules]
    others = [getattr(module, name) for module, names in loaded for name in names]
    return (OSError, ImportError, ValueError, zipfile.BadZipFile, *others)


@contextmanager
def told(uri: str, what: str, advice: str | None = None, also: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """A place is opened or read in it: ConfigurationError, which begins with `what`; `also` of other errors."""
    try:
        yield
    except (*store_errors(), *also) as error:
        said = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise ConfigurationError(f"{what}: {said}", file=uri, advice=advice) from error


@contextmanager
def asked() -> Iterator[None]:
    """A store is asked in it: OSError, whatever its client raises."""
    try:
        yield
    except OSError:
        raise
    except store_errors() as error:
        raise OSError(str(error)) from error
