"""An independent look at a page: is every element closed, is any id there twice, is anything fetched?"""

from __future__ import annotations

import re
from html.parser import HTMLParser

VOID = {"meta", "br", "img", "hr", "link", "input"}


class Checker(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.problems: list[str] = []
        self.ids: list[str] = []
        self.tags: set[str] = set()
        self.links: list[str] = []
        self.words: list[str] = []
        self.handlers: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._note(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._note(tag, attrs)

    def _note(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in ("href", "src", "xlink:href", "action", "data", "srcset"):
                self.links.append(value or "")
            if name.startswith("on"):
                self.handlers.append(name)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open[-1] != tag:
            self.problems.append(f"</{tag}> at {self.getpos()} closes {self.open[-3:]}")
        else:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def shown(self) -> str:
        return " ".join(" ".join(self.words).split())


def check(page: str) -> Checker:
    """Assert that a page is balanced, self-contained and without script; return what was seen in it."""
    seen = Checker()
    seen.feed(page)
    seen.close()
    assert not seen.problems, seen.problems[:3]
    assert not seen.open, seen.open
    assert len(seen.ids) == len(set(seen.ids)), sorted(i for i in seen.ids if seen.ids.count(i) > 1)[:5]
    assert not seen.tags & {"script", "iframe", "link", "object", "embed", "base"}
    assert not seen.handlers
    for link in seen.links:
        assert link.startswith("#") or link.startswith("data:image/png;base64,") or re.fullmatch(r"[\w.%-]+", link), (
            link
        )
        if link.startswith("#"):
            assert link[1:] in seen.ids, f"{link} leads nowhere"
    assert "http:" not in page and "https:" not in page and "@import" not in page
    for target in re.findall(r"url\(([^)]*)\)", page):
        assert target.startswith("#") and target[1:] in seen.ids, target
    for name in re.findall(r"var\(--([\w-]+)\)", page):
        assert f"--{name}:" in page, name
    return seen
