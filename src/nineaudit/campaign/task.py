"""The audit of one recording of a campaign, as Dask, Ray, a Slurm array or Airflow may call it: no engine in here.

What was finished is not done again: an entry's key is a hash of the recording, the rig, the rules, the tool, the
waivers and the databases, so that the same key is the same answer.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from nineaudit.campaign import lake as lakes
from nineaudit.campaign.making import audited, failed, gate_of, hashes_of, key_of
from nineaudit.campaign.naming import report_as_named
from nineaudit.campaign.places import fetched, recording_files, signature
from nineaudit.campaign.settings import Document, Setting, collect, identity, load, rig_bytes
from nineaudit.errors import ConfigurationError

if TYPE_CHECKING:
    from nineaudit.campaign.lake import Lake

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
        return _entry_of(uri, setting, test or {})
    opened = lakes.open_lake(lake, create=True)
    prepare(opened, document)
    summary = audit_into(opened, uri, setting, dict(test or {}), resume, reports)
    lakes.make_newest(opened, setting.edition)
    return summary


def audit_into(
    lake: Lake, uri: str, setting: Setting, test: dict[str, str], resume: bool = False, reports: str = "failed"
) -> Summary:
    """Audit a recording into a lake, unless its entry is there; the summary of `audit_one`.

    Where it cannot be fetched this time, the entry of it as it was read last stays the current one."""
    require_reports(reports)
    with ExitStack() as stack:
        try:
            seen = signature(recording_files(uri, setting.rig.parts))
            known = _known(lake, uri, seen, setting, test, reports) if resume else None
            if known is not None:
                return known
            path = stack.enter_context(fetched(uri, setting.rig.parts))
        except OSError as error:
            return _not_fetched(lake, uri, setting, test, error)
        hashes = hashes_of(path, setting)
        kept = _kept(lake, uri, key_of(hashes, setting, test), setting.edition, reports)
        summary = kept or _written(lake, uri, path, hashes, setting, test, reports)
    if hashes:
        lakes.write(lake, _stat_name(uri), {"uri": uri, "signature": seen, "sha256": hashes})
    return summary


def _entry_of(uri: str, setting: Setting, test: Mapping[str, str]) -> dict[str, Any]:
    with ExitStack() as stack:
        try:
            path = stack.enter_context(fetched(uri, setting.rig.parts))
        except OSError as error:
            return failed(uri, setting, test, _why(error))
        return audited(uri, path, hashes_of(path, setting), setting, test)[0]


def _not_fetched(lake: Lake, uri: str, setting: Setting, test: dict[str, str], error: OSError) -> Summary:
    """The summary of a recording that could not be fetched. There is no new entry where it has one that holds if it is
    as it was."""
    if isinstance(error, FileNotFoundError):
        return write_failure(lake, uri, setting, test, _why(error), transient=False)
    stat = lakes.read(lake, _stat_name(uri))
    before = stat and _kept(lake, uri, key_of(stat["sha256"], setting, test), setting.edition, "none")
    if not before:
        return write_failure(lake, uri, setting, test, _why(error), transient=True)
    reason = f"{uri}: {_why(error)}; its result of before stands"
    return {**before, "verdict": "not_audited", "gate": None, "transient": True, "reason": reason}


def _why(error: OSError) -> str:
    """Why a recording could not be fetched."""
    return "no such file" if isinstance(error, FileNotFoundError) else f"cannot be fetched: {error}"


def prepare(lake: Lake, document: Document) -> str:
    """Put a setting into a lake, where workers find it; its identity."""
    setting, name = load(document), identity(document)
    if not lakes.exists(lake, f"inputs/{name}.json"):
        lakes.write_bytes(lake, f"rigs/{setting.rig.sha256}.toml", rig_bytes(document))
        lakes.write(lake, f"inputs/{name}.json", document)  # last: where it is there, so is the rig
    return name


def write_failure(
    lake: Lake, uri: str, setting: Setting, test: dict[str, str], reason: str, *, transient: bool
) -> Summary:
    """Write the entry of a recording that could not be audited, with its reason. `transient`: the next run tries it
    again."""
    entry = failed(uri, setting, test, reason)
    entry = {**entry, "reason": entry["result"]["reason"], "transient": True} if transient else entry
    return _put(lake, entry, None)


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
        pointer = {"key": key, **_pointer(entry, gate_of(entry["result"]))}
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
    from nineaudit.report import render

    entry, outcome = audited(uri, path, hashes, setting, test)
    gate = gate_of(entry["result"])
    if outcome.audit is not None and _asked(reports, gate):
        page = report_as_named(render(outcome.audit), uri, path, setting)
        lakes.write_text(lake, lakes.report_name(uri, entry["key"]), page)
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


def _stat_name(uri: str) -> str:
    return f"stats/{lakes.hashed(uri)}.json"
