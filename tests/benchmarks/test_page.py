"""The page of figures: a part measured anew leaves the others as they were."""

from __future__ import annotations

from tests.benchmarks.__main__ import page, renewed
from tests.benchmarks.report import Goal, Section, Table


def section(title: str, figure: str, *goals: str) -> Section:
    rows: list[Goal] = [Goal(what, "< 1", figure, True) for what in goals]
    return Section(title, f"How {title} is measured.", [Table(("what", "s"), [(title, figure)])], rows)


TITLES = ["one", "two", "three"]
OLD = page([section("one", "1.0", "one"), section("two", "2.0", "two: a", "two: b")], "a machine")


def test_a_part_anew_keeps_all_else() -> None:
    new = renewed(OLD, [section("two", "9.0", "two: a", "two: c")], "another", TITLES)
    assert new.startswith(OLD[: OLD.index("| what")])
    assert OLD[OLD.index("## one") : OLD.index("## two")] in new
    assert "Measured alone, on: another." in new[new.index("## two") :] and "another" not in new[: new.index("## two")]
    goals = [line.split("|")[1].strip() for line in new[: new.index("## one")].splitlines() if "< 1" in line]
    assert goals == ["one", "two: a", "two: c"]
    assert "2.0" not in new and new.count("9.0") == 3 and "\n\n\n" not in new


def test_a_new_part_stands_in_its_place() -> None:
    both = renewed(OLD, [section("three", "3.0", "three")], "m", TITLES)
    assert [line for line in both.splitlines() if line.startswith("## ")] == ["## one", "## two", "## three"]
    first = renewed(both, [section("three", "3.5", "three")], "m", ["three", "one", "two"])
    assert [line for line in first.splitlines() if line.startswith("## ")] == ["## three", "## one", "## two"]
    assert "3.0" not in first
