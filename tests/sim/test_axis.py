from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.axis import GRAVITY_M_S2, BenchPlant, ServoSettings
from sim.model import Model

PAD = Model.from_dict(
    {
        "pad": {
            "elastic": {"law": "exponential", "m": 2.24, "b": 0.69},
            "relaxation": {"shares": [0.25, 0.15], "rates": [4.0, 0.35]},
        }
    }
)
FULL = Model.from_dict(
    PAD.to_dict() | {"effects": [{"id": "friction", "coulomb": 0.05}, {"id": "frame_compliance", "compliance": 0.01}]}
)
AIR = Model.from_dict({"pad": {"elastic": {"law": "none"}}})
SURFACE = 0.3


def bench(model: Model = PAD, position_mm: float = -1.0, **settings: object) -> BenchPlant:
    return BenchPlant(ServoSettings(**settings), model, SURFACE, position_mm)  # type: ignore[arg-type]


def trapezoid(length: float, speed: float, acceleration: float) -> Callable[[float], float]:
    """Position of a rest-to-rest move that reaches its speed."""
    ramp = speed / acceleration
    end = length / speed + ramp

    def position(t: float) -> float:
        if t <= 0:
            return 0.0
        if t < ramp:
            return 0.5 * acceleration * t * t
        if t < end - ramp:
            return speed * (t - 0.5 * ramp)
        if t < end:
            return length - 0.5 * acceleration * (end - t) ** 2
        return length

    return position


def stream(plant: BenchPlant, path: Callable[[float], float], duration: float, period: float = 1e-3) -> np.ndarray:
    """Send set-points every period; returns (n, 2): set-point and true position at the same times."""
    rows = []
    start = plant.time_s
    for n in range(round(duration / period)):
        plant.advance(start + n * period)
        wanted = path(n * period)
        rows.append((wanted, plant.position_mm))
        plant.hold(wanted)
    return np.array(rows)


@pytest.mark.parametrize(("speed", "allowed"), [(80.0, 0.1), (200.0, 0.3)])
@pytest.mark.parametrize("model", [PAD, AIR, FULL], ids=["pad", "air", "full"])
def test_a_stream_is_followed(speed: float, allowed: float, model: Model) -> None:
    move = trapezoid(12.7, speed, 5000.0)
    rows = stream(bench(model, -10.0), lambda t: -10.0 + move(t - 0.05), 0.6)
    assert np.abs(rows[:, 0] - rows[:, 1]).max() < allowed
    assert rows[:, 1].max() < 2.7 + 0.05  # hardly over the end, into the pad
    assert abs(rows[-1, 1] - 2.7) < 0.003


def test_one_command_is_not_a_stream() -> None:
    plant = bench(AIR)
    plant.hold(-1.0)
    plant.advance(1.0)
    plant.hold(-0.9)  # a second late: no speed may be read into 0.1 mm
    plant.advance(1.5)
    rows = plant.history(1.0)[1]
    assert rows.max() < -0.9 + 0.02
    assert_allclose(plant.position_mm, -0.9, atol=1e-3)


def test_a_stream_that_ends_does_not_run_on() -> None:
    plant = bench(AIR)
    stream(plant, lambda t: -1.0 + 80.0 * t, 0.02)
    last = plant.setpoint_mm
    plant.advance(plant.time_s + 0.5)
    assert_allclose(plant.position_mm, plant.setpoint_mm, atol=1e-3)
    assert abs(plant.setpoint_mm - last) < 0.2
    assert not plant.moving


class TestTime:
    def drive(self, times: list[float]) -> list[tuple[float, ...]]:
        """Commands at fixed times, with advances between them as given."""
        plant = bench(FULL)
        commands: dict[float, Callable[[], None]] = {
            0.0101: lambda: plant.profile(2.0, 60.0, 4000.0),
            0.0523: lambda: plant.halt(3000.0),
            0.0802: lambda: plant.hold(1.0),
            0.0811: lambda: plant.hold(1.05),
            0.1203: plant.release,
        }
        rows = []
        for t in sorted({*times, *commands, 0.2}):
            plant.advance(t)
            if t in commands:
                commands[t]()
                rows.append((plant.position_mm, plant.speed_mm_s, plant.force_N, plant.motor_force_N))
        return [*rows, (plant.position_mm, plant.speed_mm_s, plant.force_N, plant.motor_force_N)]

    def test_the_result_does_not_hang_on_how_often_it_was_asked(self) -> None:
        rare = self.drive([])
        assert rare == self.drive(np.linspace(0.0, 0.2, 77).tolist())
        assert rare == self.drive((np.arange(2000) * 1e-4).tolist())
        assert rare == self.drive(np.random.default_rng(1).uniform(0.0, 0.2, 500).tolist())
        assert rare[-1] != rare[-2]

    def test_going_back_is_nothing(self) -> None:
        plant = bench()
        plant.advance(0.5)
        plant.advance(0.1)
        assert plant.time_s == 0.5

    def test_between_substeps_it_is_linear(self) -> None:
        plant = bench(AIR)
        plant.profile(1.0, 50.0, 2000.0)
        h = plant.settings.substep_s
        plant.advance(40 * h)
        a = plant.position_mm
        plant.advance(40.25 * h)
        b = plant.position_mm
        plant.advance(41 * h)
        c = plant.position_mm
        assert_allclose(b, a + 0.25 * (c - a), rtol=1e-12)


class TestProfile:
    def test_it_is_a_trapezoid(self) -> None:
        plant = bench(AIR, position_mm=-5.0)
        plant.profile(5.0, 50.0, 1000.0)
        move = trapezoid(10.0, 50.0, 1000.0)
        for t in np.arange(0.001, 0.3, 0.001):
            plant.advance(float(t))
            # the set-point in use was read at the start of the substep
            assert_allclose(plant.setpoint_mm, -5.0 + move(t - plant.settings.substep_s), atol=1e-9)
            assert abs(plant.position_mm - plant.setpoint_mm) < 0.05
            assert plant.moving == (t < 0.25) or abs(t - 0.25) < 0.03
        assert_allclose(plant.setpoint_mm, 5.0, rtol=1e-12)

    def test_a_short_move_is_a_triangle(self) -> None:
        plant = bench(AIR, position_mm=0.0)
        plant.profile(0.1, 50.0, 1000.0)  # would need 2.5 mm to reach 50 mm/s
        duration = 2 * np.sqrt(0.1 / 1000.0)
        plant.advance(duration + 0.001)
        assert_allclose(plant.setpoint_mm, 0.1, rtol=1e-9)
        assert plant.history(0.0)[1].max() < 0.1 + 0.002

    @pytest.mark.parametrize("target", [4.0, 2.0, 1.02, 0.9, -3.0])
    @pytest.mark.parametrize("speed", [10.0, 60.0, 200.0])
    def test_a_new_target_on_the_way_is_reached_without_a_jump(self, target: float, speed: float) -> None:
        plant = bench(AIR, position_mm=0.0)
        plant.profile(8.0, 60.0, 4000.0)
        plant.advance(0.025)
        plant.profile(target, speed, 4000.0)
        setpoints = []
        while plant.time_s < 1.5:
            plant.advance(plant.time_s + plant.settings.substep_s)
            setpoints.append(plant.setpoint_mm)
        path = np.array(setpoints)
        h = plant.settings.substep_s
        v = np.diff(path) / h
        assert np.abs(np.diff(v)).max() < 4000.0 * h * 1.001
        assert np.abs(v).max() < max(60.0, speed) * (1 + 1e-9)
        assert_allclose(path[-1], target, rtol=1e-12)

    def test_halt_stops_in_v_squared_over_2a(self) -> None:
        plant = bench(AIR, position_mm=0.0)
        plant.profile(15.0, 60.0, 4000.0)
        plant.advance(0.1)
        at = plant.setpoint_mm
        plant.halt(2000.0)
        plant.advance(0.2)
        # within one substep of travel, as the halt starts on the grid
        assert_allclose(plant.setpoint_mm - at, 60.0**2 / 4000.0, atol=60 * plant.settings.substep_s * 1.01)
        assert not plant.moving

    def test_nonsense_is_refused(self) -> None:
        plant = bench()
        for call in (
            lambda: plant.profile(1.0, 0.0, 1.0),
            lambda: plant.profile(1.0, 1.0, -1.0),
            lambda: plant.halt(0),
        ):
            with pytest.raises(ValueError, match="greater than 0"):
                call()


class TestForces:
    def test_the_pad_pushes_the_motor(self) -> None:
        """At rest the drive holds what the cell feels, to within the rail's friction."""
        plant = bench(FULL)
        plant.profile(2.0, 20.0, 2000.0)
        plant.advance(3.0)
        assert plant.force_N > 2.0
        assert abs(plant.motor_force_N - plant.force_N) <= plant.settings.rail_friction_N + 1e-6
        assert_allclose(plant.plant.probe_mm, plant.position_mm - SURFACE - 0.01 * plant.force_N, atol=1e-9)

    def test_without_an_integral_the_load_shows_as_an_error_of_position(self) -> None:
        plant = bench(PAD, integral_per_s=0.0, rail_friction_N=0.0)
        plant.profile(2.0, 20.0, 2000.0)
        plant.advance(8.0)
        stiffness = plant.settings.moving_mass_kg * plant.settings.omega**2 / 1000.0  # N/mm
        assert_allclose(2.0 - plant.position_mm, plant.force_N / stiffness, rtol=1e-3)

    def test_a_limited_drive_cannot_push_further(self) -> None:
        plant = bench(PAD, max_force_N=3.0)
        plant.profile(2.5, 20.0, 2000.0)
        plant.advance(3.0)
        assert plant.position_mm < 2.0
        assert_allclose(plant.motor_force_N, 3.0)
        assert abs(plant.force_N - 3.0) <= plant.settings.rail_friction_N + 0.01

    @pytest.mark.parametrize("rail", [0.5, 2.0])
    def test_released_the_pad_pushes_it_out_and_friction_stops_it(self, rail: float) -> None:
        plant = bench(PAD, rail_friction_N=rail)
        plant.profile(2.0, 20.0, 2000.0)
        plant.advance(1.0)
        plant.release()
        assert not plant.servo_on
        plant.advance(5.0)
        assert plant.motor_force_N == 0.0
        assert plant.position_mm < 1.5
        assert plant.speed_mm_s == 0.0
        assert 0.0 <= plant.force_N <= rail

    def test_a_push_ends_where_the_pad_pushes_back(self) -> None:
        plant = bench(PAD, rail_friction_N=0.0)
        plant.push(3.0, damping_N_s_mm=0.05)
        plant.advance(30.0)
        assert plant.servo_on
        assert_allclose(plant.force_N, 3.0, atol=0.01)
        plant.hold(plant.position_mm)
        plant.advance(30.5)
        assert_allclose(plant.force_N, 3.0, atol=0.1)

    def test_a_push_in_air_is_force_over_mass(self) -> None:
        plant = bench(AIR, rail_friction_N=0.0)
        plant.push(1.0)
        plant.advance(0.05)
        assert_allclose(plant.speed_mm_s, 1000.0 * 1.0 / 0.5 * 0.05, rtol=1e-9)
        with pytest.raises(ValueError, match="damping must be from 0 to 2"):
            plant.push(0.0, damping_N_s_mm=2.1)

    def test_the_limit_can_be_lowered_on_the_way(self) -> None:
        plant = bench(PAD)
        plant.limit_force(3.0)
        plant.profile(2.5, 20.0, 2000.0)
        plant.advance(3.0)
        assert_allclose(plant.motor_force_N, 3.0)
        plant.limit_force(1e9)
        plant.advance(6.0)
        assert_allclose(plant.position_mm, 2.5, atol=0.003)

    def test_released_in_air_it_stays(self) -> None:
        plant = bench(PAD)
        plant.advance(2.0)
        assert plant.position_mm == -1.0

    def test_a_vertical_axis_falls_onto_the_pad_and_rests_on_it(self) -> None:
        plant = bench(PAD, vertical=True, rail_friction_N=0.0)
        plant.advance(0.01)
        assert_allclose(plant.speed_mm_s, 1000 * GRAVITY_M_S2 * 0.01, rtol=1e-9)
        # friction-free it bounces for a while; the viscoelastic pad takes the energy out
        plant.advance(60.0)
        assert_allclose(plant.force_N, 0.5 * GRAVITY_M_S2, rtol=0.02)

    def test_a_brake_holds_a_vertical_axis(self) -> None:
        plant = bench(PAD, vertical=True)
        plant.brake(True)
        plant.advance(1.0)
        assert plant.braked
        assert plant.position_mm == -1.0
        plant.brake(False)
        plant.advance(1.2)
        assert plant.position_mm > -1.0

    def test_a_held_vertical_axis_does_not_sag(self) -> None:
        plant = bench(AIR, vertical=True)
        plant.hold(-1.0)
        plant.advance(1.0)
        assert_allclose(plant.position_mm, -1.0, atol=0.002)

    def test_end_stops(self) -> None:
        plant = bench(AIR, stroke_mm=(-2.0, 2.0))
        plant.hold(5.0)
        plant.advance(1.0)
        assert plant.position_mm == 2.0
        assert plant.at_end_stop == 1
        plant.hold(-5.0)
        plant.advance(2.0)
        assert plant.position_mm == -2.0
        assert plant.at_end_stop == -1
        plant.hold(0.0)
        plant.advance(3.0)
        assert plant.at_end_stop == 0

    def test_speed_limit(self) -> None:
        plant = bench(AIR, position_mm=-15.0, max_speed_mm_s=100.0, max_acceleration_mm_s2=20000.0)
        plant.hold(15.0)
        plant.advance(1.0)
        t, x, _ = plant.history(0.0)
        assert np.abs(np.diff(x) / np.diff(t)).max() < 100.0 * 1.06
        assert_allclose(plant.position_mm, 15.0, atol=0.01)


def test_at_rest_the_servo_does_not_hunt() -> None:
    plant = bench(FULL)
    plant.profile(2.0, 20.0, 2000.0)
    plant.advance(2.0)
    plant.advance(4.0)
    _, x, _ = plant.history(2.1)
    assert np.ptp(x) < 0.001


def test_force_is_the_models_for_the_positions_it_went_through() -> None:
    plant = bench(FULL)
    plant.profile(2.2, 80.0, 5000.0)
    plant.advance(1.0)
    t, x, force = plant.history(0.0)
    assert t[0] == 0.0
    assert_allclose(force, FULL.simulate(t, x - SURFACE), atol=1e-10)


def test_sensed_force_without_a_force_path_is_the_force() -> None:
    plant = bench(FULL)
    plant.profile(2.2, 80.0, 5000.0)
    plant.advance(0.0312)
    now = plant.force_N
    plant.advance(0.5)
    assert plant.sensed_force_N(0.0312) == now
    assert plant.reported_position_mm == plant.position_mm


def test_settings_that_cannot_be() -> None:
    with pytest.raises(ValueError, match="outside the stroke"):
        bench(position_mm=30.0)
    with pytest.raises(ValueError, match="lower, upper"):
        ServoSettings(stroke_mm=(1.0, 1.0))
    with pytest.raises(ValueError, match="substeps shorter"):
        ServoSettings(bandwidth_hz=900.0)
    with pytest.raises(ValueError, match="greater than 0"):
        ServoSettings(moving_mass_kg=0.0)
