"""What is made of a run that says nothing about its pad."""

from __future__ import annotations

import pytest

from bench.config import load_model
from bench.diagnose import diagnose
from bench.errors import InputError
from bench.results import analyse
from sim.model import Model
from tests.bench.run.benches import SHORT, is_unplugged, merged, once, run


@pytest.fixture(scope="module")
def stopped_in_air(tmp_path_factory):
    """A run whose motor goes silent on the way to the surface, well above it."""
    slow = merged(SHORT, {"approach": {"retract": 1.0}, "steps": [{"to": 1.0, "speed": 1, "hold": 1}]})
    begun: list[float] = []

    def late_enough(bench_s: float, label: str) -> bool:
        if "steps[0]" in label and not begun:
            begun.append(bench_s)
        return bool(begun) and bench_s > begun[0] + 0.5

    return run(tmp_path_factory.mktemp("air"), slow, hook=once(late_enough, is_unplugged("motor")))


def test_a_run_stopped_before_contact_has_no_fit(stopped_in_air):
    made = analyse(stopped_in_air.folder)
    assert made.fit is None and "never in the pad where the force counts" in made.problem
    assert made.diagnosis is None
    page = made.report.read_text()
    assert "No model was fitted" in page and "explains the force" not in page
    assert not (stopped_in_air.folder / "model.yaml").exists()


def test_a_run_stopped_before_contact_has_no_diagnosis(stopped_in_air):
    with pytest.raises(InputError, match="never in the pad where the force counts"):
        diagnose(stopped_in_air.recording.measurement(), load_model("polyurethane"))


def test_a_pad_believed_with_effects_is_said_to_be_fitted_without_them(tmp_path):
    ran = run(tmp_path, SHORT)
    plain = load_model("polyurethane")
    with_frame = Model.from_dict(plain.to_dict() | {"effects": [{"id": "frame_compliance", "compliance": 0.001}]})
    for believed, said in ((plain, False), (with_frame, True)):
        fit = analyse(ran.folder, believed=believed).fit
        assert fit is not None
        assert any("effects of the bench (frame_compliance)" in note for note in fit.notes) == said
