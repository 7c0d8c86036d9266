import ctypes
import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from bench.cli import COMMANDS
from bench.commands import export
from bench.errors import InputError, Refused
from bench.export import LivePad, c_header, describe
from sim.effects import Effect, Form
from sim.model import Model
from sim.pad import Cascade, Pad
from sim.relaxation import Relaxation
from sim.transfer import frequency_response

CC, CXX = shutil.which("cc"), shutil.which("c++")
needs_cc = pytest.mark.skipif(CC is None, reason="no C compiler")
STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror"]

LAWS: dict[str, dict[str, Any]] = {
    "exponential": {"law": "exponential", "m": 2.24, "b": 0.69},
    "straight": {"law": "exponential", "m": 2.24, "b": 0.0},
    "softening": {"law": "exponential", "m": 2.24, "b": -0.3},
    "power": {"law": "power", "p": 3.8, "q": 0.77},
    "polynomial": {"law": "polynomial", "alpha": [0.02, 1.5, 0.4, 0.2]},
    "spline": {"law": "spline", "delta_mm": [0, 0.5, 1, 1.7, 2.1], "force_N": [0, 0.4, 1.2, 5, 8]},
    "none": {"law": "none"},
}
RELAXATIONS: list[dict[str, list[float]]] = [
    {"shares": [], "rates": []},
    {"shares": [0.4], "rates": [3.0]},
    {"shares": [0.25, 0.15], "rates": [4.0, 0.35]},
    {"shares": [0.4, 0.35, 0.25], "rates": [40.0, 4.0, 0.35]},
]
FRICTION = {"id": "friction", "coulomb": 0.05}


def model(elastic: str = "exponential", order: int = 2, contact: str = "unilateral", **more: Any) -> Model:
    pad = {"elastic": LAWS[elastic], "relaxation": RELAXATIONS[order], "contact": contact}
    return Model.from_dict({"pad": pad, **more})


def motion(rate_hz: float = 1000.0) -> tuple[np.ndarray, np.ndarray]:
    """A staircase up at 80 mm/s, then off the pad and back before its surface has recovered."""
    corners = [(0, -0.2), (0.1, -0.2), (0.11, 0.6), (0.6, 0.6), (0.61, 1.4), (1.2, 1.4), (1.22, 2.6), (2.0, 2.6)]
    corners += [(2.05, 0.9), (2.3, 0.9), (2.32, -0.3), (2.4, -0.3), (2.45, 1.1), (3.0, 1.1), (3.1, 0.0), (3.5, 0.0)]
    t = np.arange(int(3.5 * rate_hz)) / rate_hz
    return t, np.interp(t, *zip(*corners, strict=True))


WRAPPER = """
void run(int n, const double *dt_s, const double *x_mm, double *force_N, int fixed)
{
    static pad_state state;
    int i;
    pad_reset(&state);
    for (i = 0; i < n; ++i) {
        const pad_real x = (pad_real)x_mm[i];
        force_N[i] = (double)(fixed ? pad_step(&state, x) : pad_step_dt(&state, x, (pad_real)dt_s[i]));
    }
}
void law(int n, const double *x_mm, double *force_N)
{
    int i;
    for (i = 0; i < n; ++i) force_N[i] = (double)pad_elastic_N((pad_real)x_mm[i]);
}
"""


class Compiled:
    """A header, compiled; `double` or float."""

    def __init__(self, header: str, folder: Path, double: bool = True) -> None:
        folder.mkdir(exist_ok=True)
        (folder / "pad.h").write_text(header)
        define = "#define PAD_DOUBLE\n" if double else ""
        (folder / "try.c").write_text(define + '#include "pad.h"\n#include "pad.h"\n' + WRAPPER)
        command = [CC or "cc", "-std=c99", "-O2", *STRICT, "-shared", "-fPIC", "-o", "try.so", "try.c", "-lm"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        self.library = ctypes.CDLL(str(folder / "try.so"))

    def run(self, t: np.ndarray, x: np.ndarray, fixed: bool) -> np.ndarray:
        dt, x, force = np.diff(t, prepend=t[:1]), np.ascontiguousarray(x), np.empty(t.size)
        self.library.run(t.size, *(_pointer(a) for a in (dt, x, force)), int(fixed))
        return force

    def law(self, x: np.ndarray) -> np.ndarray:
        force = np.empty(x.size)
        self.library.law(x.size, _pointer(x), _pointer(force))
        return force


def _pointer(values: np.ndarray) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


CASES = [(law, 2, "unilateral") for law in LAWS]
CASES += [("exponential", order, contact) for order in (0, 1, 3) for contact in ("unilateral", "bonded")]


@needs_cc
@pytest.mark.parametrize(("law", "order", "contact"), CASES)
def test_header_is_the_simulation(law: str, order: int, contact: str, tmp_path: Path) -> None:
    pad = model(law, order, contact)
    t, x = motion()
    expected = pad.simulate(t, x)
    scale = max(np.abs(expected).max(), 1.0)
    if contact == "unilateral" and order > 0 and law != "none":
        let_go = (expected == 0.0) & (x > 0.0)
        assert let_go.any(), "the motion must leave a surface that has not recovered"
    compiled = Compiled(c_header(pad, 1000.0), tmp_path / "double")
    for fixed in (True, False):
        assert_allclose(compiled.run(t, x, fixed), expected, rtol=0, atol=1e-12 * scale)
    depths = np.linspace(-0.5, 3.0, 300)
    assert_allclose(compiled.law(depths), pad.pad.law.force(depths), rtol=1e-13, atol=1e-15)
    single = Compiled(c_header(pad, 1000.0), tmp_path / "float", double=False)
    for fixed in (True, False):
        assert_allclose(single.run(t, x, fixed), expected, rtol=0, atol=3e-6 * scale)


@needs_cc
def test_uneven_steps(tmp_path: Path) -> None:
    pad = model()
    rng = np.random.default_rng(3)
    t = np.append(0.0, np.cumsum(rng.choice([1e-4, 1e-3, 5e-3, 0.2], 800)))
    x = rng.uniform(-0.3, 2.5, t.size)
    compiled = Compiled(c_header(pad), tmp_path)
    assert_allclose(compiled.run(t, x, fixed=False), pad.simulate(t, x), rtol=0, atol=1e-11)


@needs_cc
def test_a_slow_mode_relaxes_in_float_at_a_high_rate(tmp_path: Path) -> None:
    """ν T = 1e-8: a step changes the mode by less than half the last digit of a float, so a plain sum stands still."""
    slow = {"elastic": LAWS["straight"], "relaxation": {"shares": [0.5], "rates": [0.01]}}
    compiled = Compiled(c_header(Model.from_dict({"pad": slow}), 1e6), tmp_path, double=False)
    t = np.arange(2_000_000) / 1e6
    force = compiled.run(t, np.ones(t.size), fixed=True)
    assert_allclose(1.0 - force[-1] / 2.24, 0.5 * -np.expm1(-0.01 * t[-1]), rtol=2e-4)  # 1 % lost, to a float's 1e-7


@needs_cc
@pytest.mark.parametrize("double", [True, False])
def test_a_bad_depth_counts_as_the_last_and_leaves_no_trace(double: bool, tmp_path: Path) -> None:
    compiled = Compiled(c_header(model()), tmp_path, double)
    t = np.arange(400) / 1000.0
    good = np.full(t.size, 1.2)
    bad = good.copy()
    bad[[50, 120, 121, 300]] = [np.nan, np.inf, 1e6, np.nan]
    assert_allclose(compiled.run(t, bad, True), compiled.run(t, good, True), rtol=1e-15)


@pytest.mark.skipif(CXX is None, reason="no C++ compiler")
def test_two_pads_in_one_program_and_in_cpp(tmp_path: Path) -> None:
    (tmp_path / "gel.h").write_text(c_header(model("spline"), name="gel", source="a */ nasty\\ name\n??/.yaml"))
    (tmp_path / "air.h").write_text(c_header(model("none", 0), name="air"))
    main = '#include "gel.h"\n#include "air.h"\nint main() { gel_state g = gel_state(); air_state a = air_state();\n'
    main += "return gel_step(&g, 1) > 0 && gel_step_dt(&g, 1, 1) > 0 && air_step(&a, 1) == 0 ? 0 : 1; }\n"
    (tmp_path / "main.cpp").write_text(main)
    flags = ["-std=c++11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
    command = [CXX or "c++", *flags, "main.cpp", "-o", "main", "-lm"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert subprocess.run([str(tmp_path / "main")]).returncode == 0


@needs_cc
def test_the_example_of_the_guide(tmp_path: Path) -> None:
    guide = Path(__file__).parents[2] / "docs" / "export.md"
    (tmp_path / "main.c").write_text(guide.read_text("utf-8").split("```c\n")[1].split("```")[0])
    (tmp_path / "gel.h").write_text(c_header(model(), 1000.0, name="gel"))
    command = [CC or "cc", "-std=c99", *STRICT, "main.c", "-o", "main", "-lm"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    printed = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True).stdout.split()
    t = np.arange(3000) / 1000.0
    expected = model().simulate(t, np.minimum(0.08 * np.arange(3000), 1.6))
    assert_allclose([float(word) for word in printed], expected[::500], atol=1e-3)


@needs_cc
def test_fast_math_in_float_is_refused_by_the_header(tmp_path: Path) -> None:
    (tmp_path / "pad.h").write_text(c_header(model()))
    (tmp_path / "main.c").write_text('#include "pad.h"\nint main(void) { return 0; }\n')
    command = [CC or "cc", "-std=c99", "-ffast-math", "-fsyntax-only", "main.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0
    assert "PAD_DOUBLE" in done.stderr
    assert subprocess.run([*command, "-DPAD_DOUBLE"], cwd=tmp_path, capture_output=True).returncode == 0


def test_header_says_where_it_comes_from() -> None:
    pad = {"elastic": LAWS["exponential"], "relaxation": RELAXATIONS[2], "std": {"m": 0.011}}
    text = c_header(Model.from_dict({"name": "Gel 7", "pad": pad}), 2000.0, source="gel.yaml")
    for words in ("gel.yaml", "Gel 7", "m = 2.24 +- 0.011 N/mm", "nu_2 = 0.35 1/s", "--rate 2000", "2000 Hz"):
        assert words in text
    assert text.isascii()
    assert "left out" not in text.lower()


@pytest.mark.parametrize(("law", "order", "contact"), CASES)
def test_live_pad_is_the_simulation(law: str, order: int, contact: str) -> None:
    pad = model(law, order, contact)
    t, x = motion(400.0)
    live = LivePad(pad)
    expected = pad.simulate(t, x)
    assert_allclose(live.simulate(t, x), expected, rtol=0, atol=1e-13 * max(np.abs(expected).max(), 1.0))
    plant = pad.plant()
    live.reset()
    for dt, depth in [(0.0, 0.5), (0.01, 1.5), (0.3, 0.2), (0.002, 1.0)]:
        plant.step(dt, depth)
        live.step(depth, dt)
        assert_allclose([live.force_N, live.elastic_force_N], [plant.force_N, plant.elastic_force_N], atol=1e-14)


def test_live_pad_refuses_nonsense_unmoved() -> None:
    live = LivePad(model())
    live.step(1.0, 0.0)
    before = live.force_N, live.elastic_force_N
    for depth, dt in [(np.nan, 0.1), (np.inf, 0.1), (1.0, -0.1), (1.0, np.nan), (1.0, np.inf)]:
        with pytest.raises(ValueError, match="no step to"):
            live.step(depth, dt)
    assert (live.force_N, live.elastic_force_N) == before


def run_state_space(space: dict[str, Any], u: np.ndarray) -> np.ndarray:
    A, B, C, D = (np.array(space[key]) for key in "ABCD")
    v, out = np.zeros(B.size), []
    for value in u:
        out.append(C @ v + D * value)
        v = A @ v + B * value
    return np.array(out)


def test_json_runs_as_it_says() -> None:
    pad = model("power", contact="bonded")
    data = json.loads(json.dumps(describe(pad, 500.0, source="pad.yaml"), allow_nan=False))
    assert Model.from_dict(data["model"]) == pad
    t, x = motion(500.0)
    Fe, expected = pad.pad.law.force(x), pad.simulate(t, x)
    discrete = data["discrete"]
    assert discrete["sample_time_s"] == 0.002
    assert_allclose(run_state_space(discrete["state_space"], Fe), expected, atol=1e-11)
    a, b = discrete["filter"]["a"], discrete["filter"]["b"]
    past_Fe, past, out = [0.0] * len(b), [0.0] * len(a), []
    for value in Fe:
        past_Fe = [value, *past_Fe[:-1]]
        force = sum(bi * u for bi, u in zip(b, past_Fe, strict=True)) - sum(
            ai * y for ai, y in zip(a[1:], past, strict=False)
        )
        past = [force, *past[:-1]]
        out.append(force)
    assert_allclose(out, expected, atol=1e-8)
    w, last, modes = np.zeros(2), 0.0, []
    for value in Fe:
        w = np.array(discrete["decay"]) * w + np.array(discrete["gain"]) * (value - last)
        last = value
        modes.append(data["relaxation"]["c_0"] * value + np.array(data["relaxation"]["shares"]) @ w)
    assert_allclose(modes, expected, atol=1e-11)


def test_json_describes_the_continuous_system() -> None:
    data = describe(model(), 1000.0)
    omega = np.geomspace(0.01, 100, 20)
    expected = frequency_response([0.25, 0.15], [4.0, 0.35], omega)
    transfer = data["transfer_function"]
    ratio = np.polyval(transfer["numerator"], 1j * omega) / np.polyval(transfer["denominator"], 1j * omega)
    assert_allclose(ratio, expected, rtol=1e-12)
    A, B, C, D = (np.array(data["state_space"][key]) for key in "ABCD")
    spaced = [C @ np.linalg.solve(1j * w * np.eye(2) - A, B) + D for w in omega]
    assert_allclose(spaced, expected, rtol=1e-12)
    assert data["discrete"]["zero_order_hold_filter"]["b"][0] == 1.0
    assert data["parameters"]["nu_1"] == {"value": 4.0, "unit": "1/s"}
    assert data["contact"] == "unilateral"


class TestEffects:
    def test_an_effect_of_the_bench_is_refused_in_words(self) -> None:
        with_friction = model(effects=[FRICTION])
        for call in (c_header, describe, LivePad):
            with pytest.raises(Refused, match=r"the effect friction \(coulomb\), which has no form in an export"):
                call(with_friction)

    def test_pad_only_leaves_it_out_and_says_so(self) -> None:
        with_friction = model(effects=[FRICTION])
        assert "Left out: friction (coulomb)" in c_header(with_friction, pad_only=True)
        assert describe(with_friction, pad_only=True)["left_out"] == ["friction (coulomb)"]
        t, x = motion(200.0)
        assert_allclose(LivePad(with_friction, pad_only=True).simulate(t, x), model().simulate(t, x), atol=1e-12)

    def test_what_bears_tension_for_a_while_or_in_part_is_refused(self) -> None:
        pad = {"elastic": LAWS["exponential"], "relaxation": RELAXATIONS[2], "contact": "bonded"}
        for form, number in (("film", "impulse"), ("breaking", "impulse"), ("partly", "bonded")):
            told = Model.from_dict({"pad": pad, "effects": [{"id": "separation", "form": form, number: 0.1}]})
            with pytest.raises(Refused, match=f"separation \\({form}\\)"):
                describe(told)

    def test_an_effect_that_is_another_pad_is_taken_in(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def one_more(pad: Pad, values: Any) -> Pad:
            r = pad.relaxation
            return Pad(pad.law, Relaxation((*r.shares, 0.1), (*r.rates, 0.05)), pad.unilateral)

        form = Form("third", "one more mode", (), amend=one_more)
        from sim.effects import Active

        plain = model(order=2)
        cascade = Cascade(plain.pad.physics(), [Active(Effect("more", "", (form,)), form, {})])
        monkeypatch.setitem(plain.__dict__, "cascade", cascade)
        data = describe(plain)
        assert data["relaxation"]["shares"] == [0.25, 0.15, 0.1]
        assert data["parameters"]["nu_3"]["value"] == 0.05
        assert data["left_out"] == []


class TestCommand:
    def run(self, *words: str) -> int:
        import argparse

        parser = argparse.ArgumentParser()
        export.arguments(parser)
        return export.main(parser.parse_args(words))

    def test_json_on_standard_output_and_nothing_else(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert self.run("polyurethane", "--to", "json", "--rate", "250") == 0
        data = json.loads(capsys.readouterr().out)
        assert data["discrete"]["rate_hz"] == 250
        assert data["elastic"] == {"law": "exponential", "m": 2.24, "b": 0.69}

    def test_header_into_a_file(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert self.run("silicone", "--to", "c", "--out", str(tmp_path / "skin.h"), "--name", "skin") == 0
        assert "wrote" in capsys.readouterr().out
        assert "skin_step(skin_state *state" in (tmp_path / "skin.h").read_text()

    def test_a_run_folder_is_a_model(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (tmp_path / "model.yaml").write_text("pad: {elastic: {law: power, p: 3.0, q: 1.0}}\n")
        assert self.run(str(tmp_path), "--to", "json") == 0
        assert json.loads(capsys.readouterr().out)["elastic"]["p"] == 3.0

    @pytest.mark.parametrize(
        ("words", "place"),
        [
            (["polyurethane", "--to", "c", "--rate", "0"], "--rate"),
            (["polyurethane", "--to", "json", "--rate", "nan"], "--rate"),
            (["polyurethane", "--to", "c", "--name", "my pad"], "--name"),
            (["polyurethane", "--to", "c", "--out", "/nonexistent/pad.h"], "/nonexistent/pad.h"),
            (["polyuretane", "--to", "c"], "polyuretane"),
        ],
    )
    def test_bad_input_names_its_place(self, words: list[str], place: str) -> None:
        with pytest.raises(InputError) as caught:
            self.run(*words)
        assert caught.value.place == place

    def test_it_is_a_command(self) -> None:
        assert "export" in COMMANDS


@pytest.mark.parametrize("name", ["int", "double", "class", "restrict", "while"])
def test_a_word_of_the_language_is_no_name(padbench, name):
    said = padbench("export", "polyurethane", "--to", "c", "--name", name)
    assert said.status == 2 and "a word of the language" in said.err and not said.out
