"""Home, jog, tare, release: what the axis does in truth, and what stops it."""

from __future__ import annotations

import io
import json
import re

import pytest

from bench.config import load_bench
from bench.daily import hand, keys
from bench.daily.open_bench import OpenBench
from bench.errors import Stopped
from tests.bench.daily.benches import in_the_world, mute
from tests.bench.run.benches import bench_file

BENCHES = ("simulated", "simulated_iai", "simulated_modbus")


def safe(world) -> bool:
    """Let go (Orca as shipped), or holding still (IAI as shipped)."""
    if world.settings.motor["safe_state"] == "release":
        return not world.plant.servo_on
    return world.plant.servo_on and not world.plant.moving


@pytest.mark.parametrize("name", BENCHES)
@pytest.mark.parametrize("by", [0.25, -1.5])
def test_a_jog_goes_where_it_says_and_ends_safe(padbench, monkeypatch, name, by):
    worlds = in_the_world(monkeypatch)
    said = padbench("jog", name, "--by", by, "--json", "-")
    assert said.status == 0, said
    assert worlds[0].plant.position_mm == pytest.approx(by, abs=0.02)
    assert json.loads(said.out)["position_mm"] == pytest.approx(by, abs=0.02)
    assert safe(worlds[0])


def test_a_jog_beyond_the_travel_is_refused_before_it_moves(padbench, tmp_path, monkeypatch):
    worlds = in_the_world(monkeypatch)
    said = padbench("jog", bench_file(tmp_path, limits={"position": [-0.3, 6]}), "--by", "-0.4")
    assert said.status == 1 and "beyond limits.position [-0.3, 6]" in said.err
    assert abs(worlds[0].plant.position_mm) < 0.005 and safe(worlds[0])


@pytest.mark.parametrize("cap", [0.3, 1.5])
def test_the_force_cap_stops_a_jog_into_the_pad(padbench, tmp_path, monkeypatch, cap):
    felt = []
    worlds = in_the_world(monkeypatch, lambda world: watch(world, felt))
    path = bench_file(tmp_path, simulation={"surface": 0.5})
    said = padbench("jog", path, "--by", 3, "--force-cap", cap)
    assert said.status == 1 and re.search(rf"force limit: .* {cap:g} N allowed", said.err)
    assert re.search(r"the axis is in its safe state, release, at \d+\.\d+ mm", said.err), "where it is now"
    # 1 mm/s on 4 N/mm at the most: two samples late are 0.02 N, five sigma of the noise are 0.05 N.
    assert cap - 0.07 < max(felt) < cap + 0.07
    assert safe(worlds[0])


def watch(world, felt: list[float]) -> None:
    """Keep the true force of the pad."""
    original = world.plant.sensed_force_N

    def sensed(at_s: float) -> float:
        force = original(at_s)
        felt.append(force)
        return force

    world.plant.sensed_force_N = sensed


def test_an_axis_that_is_not_homed_is_not_jogged_on_a_real_bench(monkeypatch):
    from bench.errors import Refused

    worlds = in_the_world(monkeypatch)
    monkeypatch.setattr(hand, "_afresh", lambda work: False)
    with OpenBench(load_bench("simulated_iai")) as work, pytest.raises(Refused, match="not homed"):
        hand.jog(work, 0.1, 1.0, 1.0)
    assert not worlds[0].plant.servo_on


def test_a_cell_that_falls_silent_stops_a_jog(monkeypatch):
    worlds = in_the_world(monkeypatch)
    with OpenBench(load_bench("simulated")) as work:

        def turn(now: float) -> None:
            if work.mover.here() > 1.0:
                mute("load_cell")(worlds[0])

        work.loop.on_turn = turn
        with pytest.raises(Stopped, match="silent"):
            hand.jog(work, 4.0, 2.0, 5.0)
    assert safe(worlds[0]) and worlds[0].plant.position_mm < 1.5


BAD = {
    "no step": (["--by", "0"], "--by: 0 mm is no step"),
    "too far": (["--by", "9"], r"--by: 9 mm is a step of over 5 mm"),
    "too far away": (["--by", "-5.1"], r"--by: -5.1 mm is a step of over 5 mm"),
    "nowhere": (["--by", "nan"], r"--by: nan mm is a step of over 5 mm"),
    "no number": (["--by", "nan"], "--by: nan mm"),
    "a word": (["--by", "much"], "'much' is no number"),
    "too fast": (["--by", "1", "--speed", "50"], "--speed: 50 mm/s"),
    "too hard": (["--by", "1", "--force-cap", "21"], "--force-cap: 21 N .* 20 N"),
    "no terminal": ([], "--by: is missing, and there is no terminal"),
    "two mistakes": (["--by", "9", "--speed", "-1"], "--by: 9 mm"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_jog_that_cannot_be_meant(padbench, case):
    words, message = BAD[case]
    said = padbench("jog", "simulated", *words)
    assert said.status == 2 and re.search(message, said.err) and not said.out


@pytest.mark.parametrize("command", ["status", "home", "jog", "tare", "release", "calibrate", "doctor"])
def test_bad_bench_files(padbench, tmp_path, command):
    more = {"jog": ["--by", "1"], "calibrate": ["--weights", "0,1,2"]}.get(command, [])
    missing = padbench(command, "nowhere.yaml", *more)
    assert missing.status == 2 and "nowhere.yaml: there is no such file" in missing.err
    path = bench_file(tmp_path, motor={"drivr": "orca"}, limits={"force": "strong"})
    both = padbench(command, path, *more)
    assert both.status == 2 and "motor.drivr: unknown key" in both.err and "limits.force" in both.err
    assert len(both.err.splitlines()) <= 6 and "Traceback" not in both.err
    gone = padbench(command, bench_file(tmp_path, motor={"port": "/dev/nowhere"}, load_cell={"port": "/dev/no"}),
                    *more, *(["--attended"] if command in ("home", "jog", "tare", "doctor") else []))  # fmt: skip
    assert gone.status == 2 and re.search(r"bench\.yaml:\d+:\d+: (motor|load_cell): ", gone.err), gone


@pytest.mark.parametrize("words", [["home"], ["jog", "--by", "1"], ["doctor", "--yes"], ["tare", "--back-off", "0.5"]])
def test_what_moves_a_real_bench_wants_somebody_there(padbench, tmp_path, words):
    path = bench_file(tmp_path, motor={"port": "/dev/nowhere"}, load_cell={"port": "/dev/no"})
    said = padbench(words[0], path, *words[1:])
    assert said.status == 1 and "--attended" in said.err


# -- keys --------------------------------------------------------------------------------------------------------------


def test_jog_by_keys_steps_as_pressed_and_stays_inside(monkeypatch, tmp_path):
    worlds = in_the_world(monkeypatch)
    pressed = iter(
        ["forth", None, "larger", "forth", "smaller", "smaller", "back", "larger", "larger", "forth", "quit"]
    )
    told: list[str] = []
    bench = load_bench(bench_file(tmp_path, limits={"position": [-5, 1.5]}, simulation={"surface": 2.0}))
    with OpenBench(bench) as work:
        end_mm = hand.jog_by_keys(work, lambda: next(pressed), told.append, 2.0, 1.0)
    assert end_mm == pytest.approx(0.1 + 1.0 - 0.01, abs=1e-9)  # the last would have left the travel
    assert any("beyond limits.position" in text for text in told)
    assert worlds[0].plant.position_mm == pytest.approx(end_mm, abs=0.01) and safe(worlds[0])


def test_keys_mean_what_they_say():
    assert [keys.meaning(text) for text in ("\x1b[A", "\x1b[B", "+", "-", "x", "\x1b[A\x1b[A", "\x1b[Aq")] == [
        "forth", "back", "larger", "smaller", None, "forth", "quit",
    ]  # fmt: skip


# -- home, tare, release -----------------------------------------------------------------------------------------------


def test_home_homes_what_is_not_homed(padbench, monkeypatch):
    worlds = in_the_world(monkeypatch)
    said = padbench("home", "simulated_iai", "--json", "-")
    assert said.status == 0 and json.loads(said.out)["homed_now"] is True
    low, high = load_bench("simulated_iai").limits.position
    assert low <= worlds[0].plant.position_mm <= high and safe(worlds[0])


def test_home_leaves_a_homed_axis_where_it_is(padbench):
    said = padbench("home", "simulated")
    assert said.status == 0 and "homed already" in said.out


def test_tare_says_mean_noise_and_drift(padbench, tmp_path):
    said = padbench("tare", bench_file(tmp_path, simulation={"noise": {"force": 0.02}}), "--json", "-")
    found = json.loads(said.out)
    assert said.status == 0
    assert found["noise_N"] == pytest.approx(0.02, rel=0.15)
    assert abs(found["mean_N"]) < 4 * found["std_of_mean_N"] + 0.001
    assert found["samples"] == pytest.approx(3 * 549, abs=10)


def test_tare_refuses_a_drift(padbench, tmp_path):
    said = padbench("tare", bench_file(tmp_path, simulation={"noise": {"drift": 0.05}}))
    assert said.status == 1 and re.search(r"no zero can be taken: the force went by \+0\.1[45]", said.err)


def test_tare_that_backs_off_finds_a_probe_that_touches(padbench, tmp_path):
    bench = bench_file(tmp_path, simulation={"surface": -0.03})
    assert padbench("tare", bench, "--back-off", "0.5").status == 1
    clear = padbench("tare", bench_file(tmp_path, simulation={"surface": 1.0}), "--back-off", "0.5")
    assert clear.status == 0 and "contact check, 0.50 mm back: passed" in clear.out


@pytest.mark.parametrize("seconds", [3, 5])
def test_tare_reads_as_long_as_it_is_told_also_after_backing_off(padbench, tmp_path, seconds):
    """549 lines a second: 115 200 baud, 21 characters of ten bits."""
    bench = bench_file(tmp_path, simulation={"surface": 1.0})
    said = padbench("tare", bench, "--back-off", "0.5", "--seconds", seconds, "--json", "-")
    found = json.loads(said.out)
    assert found["samples"] == pytest.approx(seconds * 549, abs=10) and found["seconds"] == seconds


def test_release_lets_go(padbench, monkeypatch):
    said = padbench("release", "simulated_iai")
    assert said.status == 0 and "without force" in said.out


def test_release_of_a_vertical_axis_asks_first(padbench, tmp_path, monkeypatch):
    path = bench_file(tmp_path, motor={"orientation": "vertical"})
    monkeypatch.setattr("sys.stdin", io.StringIO("n\n"))
    said = padbench("release", path)
    assert said.status == 1 and "it sinks" in said.err and "left as it is" in said.err
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    assert padbench("release", path).status == 1
    assert padbench("release", path, "--yes").status == 0


def test_release_works_with_the_load_cell_gone(monkeypatch):
    """Its line may be what is broken: only the motor is spoken to."""
    opened = hand.open_rig

    def muted(bench):
        rig = opened(bench)
        mute("load_cell")(rig.world)
        return rig

    monkeypatch.setattr(hand, "open_rig", muted)
    assert hand.release(load_bench("simulated"))["state"] == "release"
