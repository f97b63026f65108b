"""Results and reports under the names that were given: no folder of the machine on which they were made."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nineaudit.campaign.places import is_local, recording_files, split
from nineaudit.campaign.settings import Setting
from nineaudit.parts import part_of

if TYPE_CHECKING:
    from nineaudit.rig import Rig


def result_as_named(document: Mapping[str, Any], uri: str, path: Path | None, setting: Setting) -> dict[str, Any]:
    """The result with uris for the paths at which it was read (None: it was not), and sealed again."""
    from nineaudit.files import sealed

    text = json.dumps({key: value for key, value in document.items() if key != "seal"}, ensure_ascii=False)
    result: dict[str, Any] = json.loads(_named(text, uri, path, setting, _in_json))
    result["recording"]["path"] = uri
    for part, name in zip(result["recording"].get("parts", ()), recording_files(uri, setting.rig.parts), strict=False):
        part["path"] = name
    return sealed(result)


def report_as_named(html: str, uri: str, path: Path, setting: Setting) -> str:
    """The page of a report with uris for the paths at which the recording was read."""
    for file, name in zip(setting.rig.files(path), recording_files(uri, setting.rig.parts), strict=True):
        html = html.replace(f">{_in_html(file.as_posix())}<", f">{_in_html(name)}<")
    return _named(html, uri, path, setting, _in_html)


def _named(text: str, uri: str, path: Path | None, setting: Setting, quoted: Callable[[str], str]) -> str:
    """A text with names for folders of this machine: of the copy of a recording, of the rig, of the other inputs."""
    assert setting.rig.path is not None
    places = [
        (folder, "") for folder in (setting.rig.path.parent, *(path.parent for path in setting.dbc), setting.folder)
    ]
    if path is not None and not is_local(uri):
        places.insert(0, _homes(uri, path, setting.rig))
    for folder, name in places:
        text = text.replace(quoted(f"{folder}/"), quoted(name))
    return text


def _homes(uri: str, path: Path, rig: Rig) -> tuple[Path, str]:
    """The folder of a recording, below which are all of its files: that of the copy, and its name."""
    own = part_of(path, rig.parts)
    depth = own.depth if own else 1
    return path.parents[depth - 1], uri.removesuffix(split(uri)[2]).rsplit("/", depth)[0] + "/"


def _in_json(text: str) -> str:
    """A text as it stands within a JSON string."""
    return json.dumps(text, ensure_ascii=False)[1:-1]


def _in_html(text: str) -> str:
    """A text as it stands within a page."""
    from markupsafe import escape

    from nineaudit.report.numbers import printable

    return str(escape(printable(text)))
