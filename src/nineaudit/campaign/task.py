"""The audit of one recording of a campaign, as Dask, Ray, a Slurm array or Airflow may call it: no engine in here.

What was finished is not done again: an entry's key is a hash of the recording, the rig, the rules, the tool, the
waivers and the databases, so that the same key is the same answer.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, Final

from nineaudit.campaign import lake as lakes
from nineaudit.campaign.places import SIDECAR, fetched, is_local, name_of, recording_files, signature, split
from nineaudit.campaign.settings import Document, Setting, collect, identity, load, rig_bytes
from nineaudit.errors import ConfigurationError, RecordingError

if TYPE_CHECKING:
    from nineaudit.campaign.lake import Lake
    from nineaudit.checking import Outcome

Summary = dict[str, Any]
REPORTS: Final = ("failed", "all", "none")
"""Of which recordings a report is written."""


def audit_one(
    uri: str,
    rig: str | os.PathLike[str],
    rules: str | os.PathLike[str] | None = None,
    *,
    lake: str | None = None,
    dbc: Sequence[str | os.PathLike[str]] = (),
    select: str | None = None,
    ignore: str | None = None,
    waivers: str | os.PathLike[str] | None = None,
    test: Mapping[str, str] | None = None,
    resume: bool = False,
    reports: str = "failed",
) -> dict[str, Any]:
    """Audit a recording anywhere fsspec knows, with the rig file of any place; one that cannot be audited is told by
    its verdict ``not_audited``, not by an error.

    Without `lake`: the entry (``nineaudit/lake-entry/1``, its ``result`` is the result). With `lake`: it is written
    there, unless it is there already, and a summary is returned: uri, key, edition, verdict, ``gate`` (the weakest
    --fail-on that it fails, or None), ``kept`` (whether it was there). `test` columns override what the recording says
    of its test; `resume` trusts the recording's size and time instead of reading it. ConfigurationError: rig, rules,
    waivers, databases, lake.
    """
    document = collect(rig, dbc=dbc, rules=rules, select=select, ignore=ignore, waivers=waivers)
    setting = load(document)
    if lake is None:
        return _audited(uri, setting, dict(test or {}))[0]
    opened = lakes.open_lake(lake, create=True)
    prepare(opened, document)
    return audit_into(opened, uri, setting, dict(test or {}), resume, reports)


def audit_into(
    lake: Lake, uri: str, setting: Setting, test: dict[str, str], resume: bool = False, reports: str = "failed"
) -> Summary:
    """Audit a recording into a lake, unless its entry is there; the summary of `audit_one`."""
    require_reports(reports)
    with ExitStack() as stack:
        try:
            seen = signature(recording_files(uri, setting.rig.parts))
            known = _known(lake, uri, seen, setting, test, reports) if resume else None
            if known is not None:
                return known
            path = stack.enter_context(fetched(uri, setting.rig.parts))
        except FileNotFoundError:
            return write_failure(lake, uri, setting, test, "no such file", transient=False)
        except OSError as error:
            return write_failure(lake, uri, setting, test, f"cannot be fetched: {error}", transient=True)
        hashes = _hashes(path, setting)
        kept = _kept(lake, uri, key_of(hashes, setting, test), setting.edition, reports)
        summary = kept or _written(lake, uri, path, hashes, setting, test, reports)
    if seen is not None and hashes:
        lakes.write(lake, _stat_name(uri), {"uri": uri, "signature": seen, "sha256": hashes})
    return summary


def prepare(lake: Lake, document: Document) -> str:
    """Put a setting into a lake, where workers find it, and make its edition the newest; its identity."""
    setting, name = load(document), identity(document)
    if not lakes.exists(lake, f"inputs/{name}.json"):
        lakes.write(lake, f"inputs/{name}.json", document)
        lakes.write_bytes(lake, f"rigs/{setting.rig.sha256}.toml", rig_bytes(document))
    if lakes.head(lake) != setting.edition:
        lakes.write(lake, "head.json", {"edition": setting.edition})
    return name


def write_failure(
    lake: Lake, uri: str, setting: Setting, test: dict[str, str], reason: str, *, transient: bool
) -> Summary:
    """Write the entry of a recording that could not be audited, with its reason. `transient`: the next run tries it
    again."""
    from nineaudit.auditing import versions
    from nineaudit.report import failure_document

    document = failure_document(PurePath(uri), RecordingError(reason, file=uri), versions())  # type: ignore[arg-type]
    result = _as_named(document, uri, "", setting)
    entry = _entry(uri, key_of([], setting, test), setting, test, result)
    entry = {**entry, "reason": result["reason"], "transient": True} if transient else entry
    return _put(lake, entry, None)


def key_of(hashes: Sequence[str], setting: Setting, test: Mapping[str, str]) -> str:
    """The key of an entry: of the recording's files (none where they could not be read), of what it is judged by."""
    content = [list(hashes), *setting.parts_of_key(dt.date.today()), dict(sorted(test.items()))]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def require_reports(reports: str) -> None:
    """ConfigurationError where it is none of REPORTS."""
    if reports not in REPORTS:
        raise ConfigurationError("no such choice", place="--reports", found=reports, expected=", ".join(REPORTS))


def _known(
    lake: Lake, uri: str, seen: str | None, setting: Setting, test: dict[str, str], reports: str
) -> Summary | None:
    """The summary of a recording that is as it was when it was read last, and is audited."""
    stat = lakes.read(lake, _stat_name(uri)) if seen is not None else None
    if stat is None or stat["signature"] != seen:
        return None
    return _kept(lake, uri, key_of(stat["sha256"], setting, test), setting.edition, reports)


def _kept(lake: Lake, uri: str, key: str, edition: str, reports: str) -> Summary | None:
    """The summary of an entry that is there, which becomes the current one; None where it is to be made, or its report
    is."""
    pointer = lakes.current(lake, edition, uri)
    if pointer is None or pointer["key"] != key:
        entry = lakes.read_entry(lake, uri, key)
        if entry is None or entry.get("transient"):
            return None
        pointer = {"key": key, **_pointer(entry, _gate_of_document(entry["result"]))}
        lakes.point(lake, edition, uri, **pointer)
    elif pointer.get("transient") or not lakes.exists(lake, lakes.entry_name(uri, key)):
        return None
    asked = pointer["verdict"] != "not_audited" and _asked(reports, pointer["gate"])
    if asked and not lakes.exists(lake, lakes.report_name(uri, key)):
        return None
    return _summary(uri, edition, pointer, kept=True)


def _asked(reports: str, gate: str | None) -> bool:
    """Whether a report is kept."""
    return reports == "all" or (reports == "failed" and gate == "error")


def _pointer(entry: Mapping[str, Any], gate: str | None) -> dict[str, Any]:
    """What the pointer to an entry says of it."""
    found = {"verdict": entry["result"]["verdict"], "gate": gate}
    found |= {"reason": entry["result"]["reason"]} if "reason" in entry["result"] else {}
    return found | ({"transient": True} if entry.get("transient") else {})


def _written(
    lake: Lake, uri: str, path: Path, hashes: list[str], setting: Setting, test: dict[str, str], reports: str
) -> Summary:
    entry, outcome = _audited(uri, setting, test, path, hashes)
    gate = _gate_of_document(entry["result"])
    if outcome.audit is not None and _asked(reports, gate):
        _write_report(lake, outcome, entry)
    return _put(lake, entry, gate)


def _put(lake: Lake, entry: dict[str, Any], gate: str | None) -> Summary:
    pointer = _pointer(entry, gate)
    lakes.write_entry(lake, entry, **pointer)
    return _summary(entry["uri"], entry["edition"], {"key": entry["key"], **pointer}, kept=False)


def _summary(uri: str, edition: str, pointer: Mapping[str, Any], *, kept: bool) -> Summary:
    return {
        "uri": uri,
        "key": pointer["key"],
        "edition": edition,
        "verdict": pointer["verdict"],
        "gate": pointer["gate"],
        "kept": kept,
        "transient": bool(pointer.get("transient")),
        **({"reason": pointer["reason"]} if "reason" in pointer else {}),
    }


def _audited(
    uri: str, setting: Setting, test: dict[str, str], path: Path | None = None, hashes: list[str] | None = None
) -> tuple[dict[str, Any], Outcome]:
    """The entry of a recording, and the outcome that it is made of. OSError where it cannot be fetched."""
    if path is None:
        with fetched(uri, setting.rig.parts) as found:
            return _audited(uri, setting, test, found, _hashes(found, setting))
    outcome = _outcome(uri, path, setting)
    result = _as_named(outcome.document(), uri, str(path.parent) if not is_local(uri) else "", setting)
    return _entry(uri, key_of(hashes or [], setting, test), setting, test, result), outcome


def _outcome(uri: str, path: Path, setting: Setting) -> Outcome:
    """As `check` has it; but what is wrong with one rig or its databases concerns its recordings alone."""
    from nineaudit.checking import Outcome, audit_each

    waivers = setting.waivers
    if waivers is not None:
        waivers = tuple(_named(w, uri, path) for w in waivers if w.fits(PurePath(uri)))  # type: ignore[arg-type]
    try:
        return next(audit_each([path], setting.rig, setting.rulebook, waivers, setting.dbc))
    except ConfigurationError as error:
        return Outcome(path, error=error)


def _named(waiver: Any, uri: str, path: Path) -> Any:
    """A waiver that fits the uri, so that it fits the copy too."""
    return waiver if is_local(uri) else replace(waiver, recordings=path.name)


def _entry(uri: str, key: str, setting: Setting, test: dict[str, str], result: dict[str, Any]) -> dict[str, Any]:
    return {
        "schema": lakes.ENTRY,
        "key": key,
        "uri": uri,
        "edition": setting.edition,
        "test": dict(sorted(test.items())),
        "result": result,
    }


def _hashes(path: Path, setting: Setting) -> list[str]:
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


def _as_named(document: Mapping[str, Any], uri: str, copy: str, setting: Setting) -> dict[str, Any]:
    """The result with the uri for the path at which it was read, and sealed again; no folder of this machine."""
    from nineaudit.files import sealed

    text = json.dumps({key: value for key, value in document.items() if key != "seal"}, ensure_ascii=False)
    for folder, name in ((copy, uri.removesuffix(split(uri)[2]).removesuffix(name_of(uri))), (str(setting.folder), "")):
        text = text.replace(_inside(folder) + "/", _inside(name)) if folder else text
    result: dict[str, Any] = json.loads(text)
    result["recording"]["path"] = uri
    return sealed(result)


def _inside(text: str) -> str:
    """A text as it stands within a JSON string."""
    return json.dumps(text, ensure_ascii=False)[1:-1]


def _write_report(lake: Lake, outcome: Outcome, entry: Mapping[str, Any]) -> None:
    from nineaudit.report import render

    assert outcome.audit is not None
    lakes.write_text(lake, lakes.report_name(entry["uri"], entry["key"]), render(outcome.audit))


def _gate_of_document(result: Mapping[str, Any]) -> str | None:
    """The weakest --fail-on that a result fails: error, warning, or None; None too where it is not audited."""
    from nineaudit.engine import gate
    from nineaudit.finding import Finding, Severity, Verdict

    found = [Finding(f["rule"], Verdict(f["verdict"]), Severity(f["severity"]), "") for f in result["findings"]]
    return next((level for level in ("error", "warning") if not gate(found, level)), None)


def _stat_name(uri: str) -> str:
    return f"stats/{lakes.hashed(uri)}.json"
