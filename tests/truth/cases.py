"""Cases for a diagnosis: a pad, a protocol, hidden effects, noise; what the lab has, and the truth.

A case is decided by its seed; pad, protocol, channel, effects and noise have streams of their own, so that a case
with another effect or size keeps the rest. Units: mm, N, s.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from . import draw
from . import motion as motions
from .draw import DrawnPad
from .effects import EFFECTS, Build
from .effects.plant import Fine, Plant, simulate
from .effects.registry import NOISE, ROUNDING, Samples, spread
from .laws import Polynomial
from .motion import Motion
from .noise import Coloured, Quantised, SamplingJitter, StampJitter, StudentT, White
from .pad import Pad

PROTOCOLS = ("staircase", "rate_sweep", "rich", "random_steps")
NOISES = ("white", "coloured", "quantised", "heavy")
MOST_SAMPLES = 40_000


@dataclass(frozen=True)
class Truth:
    """What a case was made of. Arrays are at the force samples, NaN-free.

    parameters: by id, under the contract's names. noise_floor_N: of the force, with what noise of the position makes
    through the stiffness. clean_N: reported force without noise and without outliers and stuck samples. flags: of
    `outlier`, `stuck`, `saturated` samples. fault_N: what outliers and stuck samples are off. reported_mm: reported
    position without noise, at the rows. structure: the believed pad before its numbers were jittered. label_time_s:
    when the force was measured by the lab's reckoning, jitter of the stamps aside.
    """

    seed: int
    overrides: dict[str, Any]
    drawn: DrawnPad
    ids: tuple[str, ...]
    shapes: dict[str, str]
    sizes: dict[str, float]
    parameters: dict[str, dict[str, Any]]
    pad: Pad
    believed: Pad
    structure: Pad
    motion: Motion
    protocol: str
    rate_hz: float
    noise: White | Quantised
    position_std_mm: float
    noise_floor_N: float
    row_time_s: np.ndarray
    force_true_time_s: np.ndarray
    label_time_s: np.ndarray
    clean_N: np.ndarray
    fault_N: np.ndarray
    reported_mm: np.ndarray
    flags: dict[str, np.ndarray]
    fine: Fine

    @property
    def flagged(self) -> np.ndarray:
        """Samples with any flag."""
        return np.any([np.zeros(len(self.clean_N), dtype=bool), *self.flags.values()], axis=0)


@dataclass(frozen=True)
class Case:
    """What the lab has: the columns and the model it believes; `truth` is for the judge."""

    time_s: np.ndarray
    position_mm: np.ndarray
    force_N: np.ndarray
    force_time_s: np.ndarray | None
    believed: dict[str, Any]
    truth: Truth

    def alone(self, id: str) -> Case:
        """The same case with one of its effects alone."""
        truth = self.truth
        told = truth.overrides | {"drawn": truth.drawn, "motion": truth.motion}
        return draw_case(truth.seed, (id,), truth.sizes[id], truth.shapes[id], **told)

    def write(self, folder: str | Path) -> Path:
        """`data.csv` and `believed.yaml` in a folder, which is made if need be."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        columns = {"time_s": self.time_s, "position_mm": self.position_mm, "force_N": self.force_N}
        if self.force_time_s is not None:
            columns["force_time_s"] = self.force_time_s
        table = np.stack(list(columns.values()), axis=1)
        np.savetxt(folder / "data.csv", table, fmt="%.9g", delimiter=",", header=",".join(columns), comments="")
        (folder / "believed.yaml").write_text(yaml.safe_dump(self.believed, sort_keys=False))
        return folder


def protocol(rng: np.random.Generator, kind: str, depth_mm: float) -> Motion:
    """From air to air, 30 to 100 s, deepest at `depth_mm`."""
    while True:
        start = -float(rng.uniform(0.3, 0.8))
        common = {"start_mm": start, "acceleration_mm_s2": spread(rng, 1000.0, 8000.0)}
        fast = spread(rng, 30.0, 120.0)
        if kind == "staircase":
            up = np.linspace(0, depth_mm, int(rng.integers(5, 9)))[1:]
            levels = [*up, *up[-2::-1], start]
            hold = rng.uniform(32, 80) / len(levels)
            made = motions.staircase(levels, fast, hold, lead_s=1.0, **common)
        elif kind == "rate_sweep":
            speeds = np.geomspace(rng.uniform(0.3, 1.0), fast, int(rng.integers(3, 7)))
            hold, rest = float(rng.uniform(1, 5)), float(rng.uniform(2, 8))
            made = motions.rate_sweep(depth_mm, speeds.tolist(), hold, rest, **common)
        elif kind == "rich":
            hold, long = float(rng.uniform(0.4, 1.5)), float(rng.uniform(8, 20))
            made = motions.rich(depth_mm, (fast, fast / 8, fast / 50), hold, long, **common)
        elif kind == "random_steps":
            n = int(rng.integers(25, 60))
            levels = np.where(rng.random(n) < 0.15, start, rng.uniform(0.05, 1.0, n) * depth_mm)
            levels[rng.integers(n)] = depth_mm
            speeds, holds = (np.exp(rng.uniform(*np.log(pair), n)) for pair in ((1.0, fast), (0.1, 4.0)))
            last = ([*levels, start], [*speeds, fast], [*holds, 0.0])
            made = motions.staircase(*last, lead_s=1.0, **common)
        else:
            raise ValueError(f"no protocol {kind!r}: one of {PROTOCOLS}")
        if 28 <= made.duration_s <= 97:
            return made


def draw_case(
    seed: int,
    ids: tuple[str, ...],
    size: float | dict[str, float] | None = None,
    shape: str | dict[str, str] | None = None,
    **overrides: Any,
) -> Case:
    """A case that hides the effects named; `size` None draws 0.3 to 2 for each.

    `shape` is one for all that have it, or by id. Overrides: law, contact, protocol, rate_hz, noise_kind, noise_N,
    position_noise_mm, position_memory (samples over which noise of the position lasts; 0 if not given),
    position_step_mm, jitter ("none", "sampling", "stamp"), own_clock, believed_jitter, drawn (a DrawnPad), motion,
    servo_s (time constant with which the motor follows, critically damped; 0 if not given).
    """
    unknown = set(overrides) - set(_OVERRIDES)
    if unknown:
        raise ValueError(f"no override {sorted(unknown)}: one of {_OVERRIDES}")
    pads, moves, channel, noises, lab = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(5))
    effects = [EFFECTS[id] for id in ids]

    drawn = overrides.get("drawn") or _pad(pads, effects, overrides)
    kind = str(moves.choice(PROTOCOLS))
    kind = overrides.get("protocol", kind)
    motion = overrides.get("motion") or protocol(moves, kind, drawn.depth_mm)
    duration = motion.duration_s + 2.5

    rate = max([float(np.round(spread(channel, 100.0, 2000.0))), *(e.least_rate_hz for e in effects)])
    rate = float(overrides.get("rate_hz", min(rate, np.floor(MOST_SAMPLES / duration))))
    level, noise = _noise(channel, overrides)
    # Between slow samples of a fast motion nobody can tell where the probe was: a clock of its own needs fast ones.
    lost_mm = float(np.max(np.abs(motion.poly[:, 2]))) / (4 * rate**2)
    resolved = lost_mm * 2 * drawn.force_N / drawn.depth_mm < 0.3 * level
    own_clock = bool(overrides.get("own_clock", channel.random() < 0.3 and resolved))
    build = Build(
        drawn=drawn,
        plant=Plant(drawn.pad, motion, duration, float(overrides.get("servo_s", 0.0))),
        believed=drawn.pad,
        noise_std_N=level,
        rate_hz=rate,
        rng=pads,
        own_clock=own_clock,
    )
    sizes, shapes, parameters = {}, {}, {}
    for e in effects:
        # A stream for each, so that an effect is the same alone and in company.
        build.rng = np.random.default_rng([seed, zlib.crc32(e.id.encode())])
        drawn_size = spread(build.rng, 0.3, 2.0)
        wanted = size.get(e.id) if isinstance(size, dict) else size
        sizes[e.id] = float(drawn_size if wanted is None else wanted)
        shapes[e.id] = _shape(e, shape, build.rng)
        parameters[e.id] = e.hide(build, shapes[e.id], sizes[e.id])
    fine = simulate(build.plant)

    return _record(
        build,
        fine,
        noise,
        channel,
        noises,
        lab,
        overrides,
        {
            "seed": seed,
            "overrides": overrides,
            "drawn": drawn,
            "ids": tuple(ids),
            "shapes": shapes,
            "sizes": sizes,
            "parameters": parameters,
            "protocol": kind,
        },
    )


_OVERRIDES = (
    *("law", "contact", "protocol", "rate_hz", "noise_kind", "noise_N", "position_noise_mm", "position_memory"),
    *("position_step_mm", "jitter", "own_clock", "believed_jitter", "drawn", "motion", "servo_s"),
)


def null_case(seed: int, **overrides: Any) -> Case:
    """Nothing hidden: the believed model is right but for its numbers."""
    return draw_case(seed, (), **overrides)


def pair_case(seed: int, ids: tuple[str, str], **overrides: Any) -> Case:
    """Two effects at once, each at a half to twice its typical size."""
    if len(ids) != 2:
        raise ValueError(f"a pair is two ids, not {ids}")
    return draw_case(seed, ids, **overrides)


def _pad(rng: np.random.Generator, effects: list[Any], overrides: dict[str, Any]) -> DrawnPad:
    laws, contacts = list(draw.LAWS), ["unilateral"] * 4 + ["bonded"]
    for e in effects:
        laws = [law for law in laws if e.laws is None or law in e.laws]
        contacts = [c for c in contacts if e.contact in (None, c)]
    if not laws or not contacts:
        raise ValueError(f"no pad suits {[e.id for e in effects]} together")
    laws = [overrides["law"]] if "law" in overrides else laws
    contacts = [overrides["contact"]] if "contact" in overrides else contacts
    while True:
        drawn = draw.pad(rng, laws, contacts=contacts)
        if 3 <= drawn.force_N <= 15 and 1.5 <= drawn.depth_mm <= 3.5:
            return drawn


def _shape(effect: Any, wanted: str | dict[str, str] | None, rng: np.random.Generator) -> str:
    drawn = str(rng.choice(effect.drawn))
    if isinstance(wanted, dict):
        wanted = wanted.get(effect.id)
    elif wanted is not None and wanted not in effect.of("both"):
        wanted = None
    if wanted is not None and wanted not in effect.of("both"):
        raise ValueError(f"{effect.id} has no shape {wanted!r}: one of {effect.of('both')}")
    return wanted or drawn


def _noise(rng: np.random.Generator, overrides: dict[str, Any]) -> tuple[float, White | Quantised]:
    level, kind = spread(rng, 0.003, 0.03), str(rng.choice(NOISES))
    level, kind = float(overrides.get("noise_N", level)), overrides.get("noise_kind", kind)
    correlation, dof, ratio = spread(rng, 0.002, 0.05), float(rng.uniform(4, 8)), float(rng.uniform(0.5, 1.5))
    if kind == "quantised":
        source = level / np.sqrt(1 + ratio**2 / 12)
        return level, Quantised(ratio * source, White(source))
    return level, {"white": White(level), "coloured": Coloured(level, correlation), "heavy": StudentT(level, dof)}[kind]


def _record(
    build: Build,
    fine: Fine,
    noise: White | Quantised,
    channel: np.random.Generator,
    noises: np.random.Generator,
    lab: np.random.Generator,
    overrides: dict[str, Any],
    told: dict[str, Any],
) -> Case:
    rate = build.rate_hz
    even = np.arange(int(build.plant.duration_s * rate)) / rate
    timing, phase = _timing(channel, rate, overrides), float(channel.uniform(0, 0.9 / rate))
    if build.own_clock and isinstance(timing, StampJitter):
        # Two clocks with wrong stamps would shift the channels against each other, which is an effect of its own.
        timing = SamplingJitter(timing.std_s)
    true, stamps = timing.times(even, noises) if timing else (even, even)
    force_true, force_stamps, label = true, stamps, true
    if build.own_clock:
        late = even + phase
        force_true, force_stamps = timing.times(late, noises) if timing else (late, late)
        label = force_true
        for stage in build.stamps:
            force_stamps, label = stage(force_stamps), stage(label)
    measured_at = force_true
    for stage in build.delays:
        measured_at = stage(measured_at, noises)
    measured_at = np.maximum(measured_at, 0.0)

    clean = fine.at(measured_at)
    samples = Samples(measured_at, clean.copy(), clean, build.noise_std_N)
    source = noise.source if isinstance(noise, Quantised) else noise

    def add(s: Samples, rng: np.random.Generator) -> None:
        s.force_N = s.force_N + source.draw(force_true, rng)

    stages = [*build.samples, (NOISE, add)]
    if isinstance(noise, Quantised):
        stages.append((ROUNDING, lambda s, _: setattr(s, "force_N", np.round(s.force_N / noise.step) * noise.step)))
    stages.sort(key=lambda pair: pair[0])
    faultless = None
    for order, stage in stages:
        if order > ROUNDING and faultless is None:
            faultless = samples.force_N
        stage(samples, noises)
    fault = np.zeros_like(clean) if faultless is None else samples.force_N - faultless

    reported = fine.at(true, "reported_mm")
    std = float(channel.uniform(0, 1e-3))
    std = float(overrides.get("position_noise_mm", std))
    step = float(channel.choice([0.0, 0.0, 1e-4, 5e-4, 1e-3]))
    step = float(overrides.get("position_step_mm", step))
    memory_s = float(overrides.get("position_memory", 0.0)) / build.rate_hz
    position = reported + (Coloured(std, memory_s) if memory_s else White(std)).draw(true, noises)
    if step:
        position = np.round(position / step) * step
    position_std = float(np.hypot(std, step / np.sqrt(12)))

    believed = _jittered(build.believed, lab, float(overrides.get("believed_jitter", 0.12)))
    stiffness = _stiffness(build.plant.pad, reported)
    truth = Truth(
        pad=build.plant.pad,
        believed=believed,
        structure=build.believed,
        motion=build.plant.motion,
        rate_hz=rate,
        noise=noise,
        position_std_mm=position_std,
        noise_floor_N=float(np.sqrt(build.noise_std_N**2 + np.mean(stiffness**2) * position_std**2)),
        row_time_s=true,
        force_true_time_s=force_true,
        label_time_s=label,
        clean_N=samples.clean_N,
        fault_N=fault,
        reported_mm=reported,
        flags=samples.flags,
        fine=fine,
        **told,
    )
    own = force_stamps if build.own_clock else None
    return Case(stamps, position, samples.force_N, own, believed.model(1.2 * build.depth_mm), truth)


def _timing(rng: np.random.Generator, rate_hz: float, overrides: dict[str, Any]) -> SamplingJitter | StampJitter | None:
    kind = str(rng.choice(["none", "none", "sampling", "stamp"]))
    kind, std = overrides.get("jitter", kind), min(float(rng.uniform(0.02, 0.1)) / rate_hz, 2e-4)
    return {"none": None, "sampling": SamplingJitter(std), "stamp": StampJitter(std)}[kind]


def _jittered(pad: Pad, rng: np.random.Generator, share: float) -> Pad:
    """Each number off by up to ± share; an unknown offset term of a polynomial stays 0."""
    values = {name: value * (1 + share * rng.uniform(-1, 1)) for name, value in pad.parameters().items()}
    total = sum(v for name, v in values.items() if name.startswith("c_"))
    if total > 0.95:
        values |= {name: v * 0.95 / total for name, v in values.items() if name.startswith("c_")}
    if isinstance(pad.law, Polynomial):
        values["alpha_0"] = 0.0
    return pad.with_parameters(values)


def _stiffness(pad: Pad, depth_mm: np.ndarray) -> np.ndarray:
    """dF^e/dδ in N/mm: what a fast change of the position is worth."""
    h = 1e-4
    return (pad.law.force(depth_mm + h) - pad.law.force(depth_mm - h)) / (2 * h)
