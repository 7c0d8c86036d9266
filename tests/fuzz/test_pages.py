"""What stands in a recording is shown by the report as it is, and never becomes part of the page."""

from __future__ import annotations

import random
from html.parser import HTMLParser
from pathlib import Path

from bench.recording import Recorder, Recording, StepMark, read_recording
from bench.report.page import report_page
from tests.bench.recording.made import StillClock

HOSTILE = (
    "<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "</style><script>x</script>",
    "<svg onload=alert(1)>", "' onmouseover='alert(1)", "</title><b>", "javascript:alert(1)", "&lt;b&gt;", "<!--",
    "]]>", "\0<b\0>", "\u2028<i>", "{{7*7}}", "<a href='javascript:alert(1)'>x</a>", "&#60;script&#62;",
)  # fmt: skip


class Page(HTMLParser):
    """Tags and attributes that a page is made of, and its words."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.attributes: set[str] = set()
        self.links: list[str] = []
        self.words = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attrs}
        self.links += [value or "" for name, value in attrs if name in ("href", "src", "xlink:href")]

    def handle_data(self, data: str) -> None:
        self.words += data


def recorded(path: Path, pick: random.Random | None) -> Recording:
    """A short run; every word in it hostile, or (None) harmless."""

    def word() -> str:
        return pick.choice(HOSTILE) if pick is not None else "word"

    clock = StillClock()
    recorder = Recorder(path, clock)
    sample = {"id": word(), "age": word(), "note": word()}
    run = dict.fromkeys(("protocol", "bench", "operator", "note", "conditions", "motor", "load_cell", "seed"), "")
    recorder.begin(
        {**{key: word() for key in run}, "sample": sample, "probe": {"id": word(), "shape": word()}, "simulated": True},
        {"started": word(), "python": word(), "system": word(), "versions": {word(): word()}},
        attachments={word().replace("\0", ""): word(), "protocol.yaml": f"name: {word()!r}\n"},
    )
    recorder.event(0.0, "devices", {"motor": {"model": word(), word(): word()}, "load_cell": {"serial": word()}})
    recorder.surface(0.1, 0.0, 0.01)
    for i in range(600):
        clock.time_s = t = i * 1e-3
        if i == 200:
            recorder.step(StepMark(t, word(), "steps", "ramp", 1.0, 5.0))
            recorder.event(t, word(), {"message": word()})
        recorder.motor(t, t, 0.001 * i)
        recorder.force(t, t, 0.01 * i, 0.01 * i, (word(),))
    recorder.event(t, "stopped", {"cause": word()})
    recorder.log("error", word())
    recorder.finish({"status": word(), "cause": word(), "traffic": {word(): word()}, "safe_state": {"state": word()}})
    return read_recording(path)


def test_a_report_shows_what_it_is_given_and_is_not_changed_by_it(tmp_path):
    harmless = Page(report_page(recorded(tmp_path / "plain.mcap", None), None, host={"started": "word"}))
    assert "script" not in harmless.tags and "svg" in harmless.tags
    for seed in range(4):
        pick = random.Random(seed)
        recording = recorded(tmp_path / f"{seed}.mcap", pick)
        page = Page(report_page(recording, None, title=pick.choice(HOSTILE), fit_problem=pick.choice(HOSTILE)))
        assert page.tags <= harmless.tags | {"a"} and page.attributes <= harmless.attributes | {"href"}, seed
        assert not any(link.lower().startswith("javascript") for link in page.links)
        assert recording.run["operator"].replace("\0", "␀") in page.words
