"""Fixtures of the searches that are told what they find."""

from __future__ import annotations

import pytest


@pytest.fixture
def all_are_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.diagnose.search.believable", lambda fit, prepared: True)
    monkeypatch.setattr("bench.diagnose.exchange.believable", lambda fit, prepared: True)
    monkeypatch.setattr("bench.diagnose.search.too_small", lambda fit, prepared: False)
