"""Fixtures of the searches that are told what they find."""

from __future__ import annotations

import importlib

import pytest


@pytest.fixture
def all_are_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    search = importlib.import_module("bench.diagnose.search")
    monkeypatch.setattr(search, "believable", lambda fit, prepared: True)
    monkeypatch.setattr(search, "too_small", lambda fit, prepared: False)
