"""A recording's entry in a lake: its audit under the name that it was given, sealed, with a key that says of what."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from nineaudit.campaign import lake as lakes
from nineaudit.campaign.naming import result_as_named
from nineaudit.campaign.places import SIDECAR
from nineaudit.campaign.settings import Setting
from nineaudit.campaign.waiving import for_this
from nineaudit.errors import ConfigurationError, RecordingError

if TYPE_CHECKING:
    from nineaudit.checking import Outcome


def key_of(hashes: Sequence[str], setting: Setting, test: Mapping[str, str]) -> str:
    """The key of an entry: of the recording's files (none where they could not be read), of what it is judged by."""
    content = [list(hashes), *setting.parts_of_key(dt.date.today()), dict(sorted(test.items()))]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def audited(
    uri: str, path: Path, hashes: Sequence[str], setting: Setting, test: Mapping[str, str]
) -> tuple[dict[str, Any], Outcome]:
    """The entry of a recording that is at a path, and the outcome that it is made of."""
    outcome = _outcome(uri, path, setting)
    result = result_as_named(outcome.document(), uri, path, setting)
    return _entry(uri, key_of(hashes, setting, test), setting, test, result), outcome


def failed(uri: str, setting: Setting, test: Mapping[str, str], reason: str) -> dict[str, Any]:
    """The entry of a recording that could not be audited, with its reason."""
    from nineaudit.auditing import versions
    from nineaudit.report import failure_document

    document = failure_document(PurePath(uri), RecordingError(reason, file=uri), versions())  # type: ignore[arg-type]
    return _entry(uri, key_of([], setting, test), setting, test, result_as_named(document, uri, None, setting))


def _entry(uri: str, key: str, setting: Setting, test: Mapping[str, str], result: dict[str, Any]) -> dict[str, Any]:
    return {
        "schema": lakes.ENTRY,
        "key": key,
        "uri": uri,
        "edition": setting.edition,
        "test": dict(sorted(test.items())),
        "result": result,
    }


def hashes_of(path: Path, setting: Setting) -> list[str]:
    """SHA-256 of the recording's files and of the record of its repair; none where one cannot be read."""
    from nineaudit.readers import fingerprint

    found = []
    for file in setting.rig.files(path):
        beside = file.with_name(file.name + SIDECAR)
        try:
            found += [fingerprint(one)[1] for one in (file, *([beside] if beside.is_file() else []))]
        except (RecordingError, FileNotFoundError, IsADirectoryError, PermissionError):
            return []
    return found


def _outcome(uri: str, path: Path, setting: Setting) -> Outcome:
    """As `check` has it; but what is wrong with one rig or its databases concerns its recordings alone."""
    from nineaudit.checking import Outcome, audit_each

    waivers = None if setting.waivers is None else for_this(setting.waivers, uri)
    try:
        return next(audit_each([path], setting.rig, setting.rulebook, waivers, setting.dbc))
    except ConfigurationError as error:
        return Outcome(path, error=error)


def gate_of(result: Mapping[str, Any]) -> str | None:
    """The weakest --fail-on that a result fails: error, warning, or None; None too where it is not audited."""
    from nineaudit.engine import gate
    from nineaudit.finding import Finding, Severity, Verdict

    found = [Finding(f["rule"], Verdict(f["verdict"]), Severity(f["severity"]), "") for f in result["findings"]]
    return next((level for level in ("error", "warning") if not gate(found, level)), None)
