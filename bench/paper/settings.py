"""What the remake stands on, from settings.yaml: pads, motion, noise, starts, criteria."""

from __future__ import annotations

import functools
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from bench.trajectory import Profile
from bench.yamlfile import load
from sim.model import Model, PadSpec

Array = NDArray[np.float64]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
PadName = Literal["polyurethane", "silicone"]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Trajectory(_Part):
    """The paper's Fig. 5: fast ramps between holds, from out of contact."""

    levels_mm: tuple[float, ...] = Field(min_length=2)
    speed_mm_s: Positive
    acceleration_mm_s2: Positive
    hold_s: Positive
    rest_s: Positive

    @property
    def depth_mm(self) -> float:
        """The greatest depth."""
        return max(self.levels_mm)

    def sampled(self, spacing_s: float) -> tuple[Array, Array]:
        """Times (n,) in s from 0, and depths (n,) in mm."""
        pieces, at = [np.zeros(round(self.rest_s / spacing_s))], 0.0
        for level in self.levels_mm:
            ramp = Profile(at, level, self.speed_mm_s, self.acceleration_mm_s2)
            pieces.append(ramp.position(np.arange(round(self.hold_s / spacing_s)) * spacing_s))
            at = level
        depth = np.concatenate(pieces)
        return np.arange(depth.size, dtype=np.float64) * spacing_s, np.asarray(depth, dtype=np.float64)


class Criteria(_Part):
    """When a finding is said to come out; see the file."""

    local_minimum: Positive
    too_few: Positive
    one_iteration: Positive
    depths_mm: tuple[Positive, ...] = Field(min_length=1)
    satisfactory_V_N2: Positive
    inadequate_V_N2: Positive
    always: Annotated[float, Field(gt=0.5, lt=1)]
    fast_enough: tuple[Positive, ...]


class Settings(_Part):
    """The whole file."""

    polyurethane: PadSpec
    silicone: PadSpec
    trajectory: Trajectory
    force_spacing_s: Positive
    noise_N: Positive
    sample_time_s: Positive
    seed: Annotated[int, Field(ge=0)]
    draws: Annotated[int, Field(ge=1)]
    starts: Annotated[int, Field(ge=1)]
    criteria: Criteria
    speeds_mm_s: tuple[Positive, ...]

    def pad(self, name: PadName) -> Model:
        """The truth as a model."""
        return Model(name=name, pad=self.polyurethane if name == "polyurethane" else self.silicone)

    @property
    def noise_V_N2(self) -> float:
        """V (16) of the truth itself: the variance of the noise after the mean over a sample time, N²."""
        return self.noise_N**2 * self.force_spacing_s / self.sample_time_s


@functools.cache
def source() -> Path:
    """The file."""
    return Path(str(files("bench.paper") / "settings.yaml"))


@functools.cache
def settings() -> Settings:
    """The file's content."""
    return load(source(), Settings)[0]
