"""docs/faults.md is what its command writes."""

from pathlib import Path

from docs.faults import page
from sim.faults import FAMILIES, KINDS

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_is_up_to_date():
    assert (DOCS / "faults.md").read_text(encoding="utf-8") == page(), "run `python -m docs.faults`"


def test_every_kind_stands_in_one_family():
    listed = [kind.name for family in FAMILIES.values() for kind in family]
    assert len(listed) == len(set(listed)) == len(KINDS)
