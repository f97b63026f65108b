"""docs/index.md lists every page; links between the pages lead somewhere, headings included."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
LINK = re.compile(r"\]\(([^)\s]+)\)")


def prose(page: Path) -> str:
    """A page without its code blocks and code."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"`[^`\n]+`", "", text)


def headings(page: Path) -> set[str]:
    """The anchors that the headings of a page get on GitHub and GitLab."""
    found = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in found}


def test_the_index_lists_every_page_and_the_readme_leads_to_it() -> None:
    listed = set(LINK.findall(prose(DOCS / "index.md")))
    assert {page.name for page in DOCS.glob("*.md")} - {"index.md"} <= listed
    assert {"rules/index.md", "../reports/report.html"} <= listed
    assert {"docs/index.md", "docs/tutorial.md", "docs/images/report.png"} <= set(
        LINK.findall(prose(ROOT / "README.md"))
    )


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_of_a_page_leads_somewhere(page: Path) -> None:
    broken = []
    for link in LINK.findall(prose(page)):
        place, _, heading = link.partition("#")
        target = page if not place else page.parent / place
        if "://" not in link and (not target.exists() or (heading and heading not in headings(target))):
            broken.append(link)
    assert broken == []


def test_pictures_are_small() -> None:
    sizes = {picture.name: picture.stat().st_size for picture in (DOCS / "images").iterdir()}
    assert sizes
    assert {name: size for name, size in sizes.items() if size > 200_000} == {}
