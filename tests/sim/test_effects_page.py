"""docs/effects.md is what its command writes, and knows every cause."""

from pathlib import Path

from docs.effects import GROUPS, LOOK_ALIKES, SHOWN, page
from sim.effects import all_effects, effect

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_is_up_to_date() -> None:
    assert (DOCS / "effects.md").read_text(encoding="utf-8") == page(), "run `python -m docs.effects`"


def test_every_cause_has_its_place_and_picture() -> None:
    placed = [name for names in GROUPS.values() for name in names]
    assert sorted(placed) == sorted(all_effects())
    pictures = {path.stem: path.stat().st_size for path in (DOCS / "img" / "effects").glob("*.png")}
    assert set(pictures) == set(placed)
    assert sum(pictures.values()) < 1_500_000


def test_what_the_page_names_exists() -> None:
    for names in LOOK_ALIKES:
        assert set(names) <= set(all_effects())
    for (name, form), values in SHOWN.items():
        effect(name).active(form, **values)
