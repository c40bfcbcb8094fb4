"""Ground speed from satellite fixes: accuracy, jumps, real changes of speed, latency, faults."""

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given
from hypothesis import strategies as st

from traction_controller.estimation.gnss import GnssNoise, GnssTrack, RimTravel

DT = 0.1


def drive(track, speeds, rims=None, shifts=None, noise=0.0, seed=1, heading=0.3, dt=DT):
    """Feed fixes of a straight drive; returns the output of the track after each."""
    random = np.random.default_rng(seed)
    along = np.array([math.cos(heading), math.sin(heading)])
    travelled, said = 0.0, []
    for k, v in enumerate(speeds):
        travelled += v * dt if k else 0.0
        place = travelled * along + noise * random.standard_normal(2)
        if shifts is not None and k in shifts:
            place = place + shifts[k]
        if rims is not None:
            track.wheels(k * dt, rims[k])
        believed = track.fix(k * dt, place)
        said.append((believed, track.speed, track.distance))
    return travelled, np.array(said)


def test_a_steady_drive_by_hand():
    track = GnssTrack()
    # 1.5 m/s for 20 s: the first fix starts, the second gives the speed.
    drive(track, [1.5] * 201)
    assert track.speed == pytest.approx(1.5)
    assert track.heading == pytest.approx(0.3)
    assert track.valid
    assert track.refused == track.rebased == 0
    # At the second fix the speed is not yet known to 0.5 m/s: 0.02*sqrt(2)/0.1 s = 0.28 m/s is
    # less than that, so that it counts from there on: all but the first interval's 0.15 m.
    assert track.distance == pytest.approx(1.5 * 20.0, abs=0.16)


def test_agrees_with_an_independent_filter():
    """Without wheels it is a linear filter, on each axis the same."""
    noise = GnssNoise(position=0.03, acceleration=0.4, manoeuvre=1e-9)
    track = GnssTrack(noise, gate=1e6)
    random = np.random.default_rng(3)
    places = np.cumsum(random.standard_normal((50, 2)) * 0.1, axis=0)
    track.fix(0.0, places[0])
    peers = []
    for axis in range(2):
        peer = KalmanFilter(dim_x=2, dim_z=1)
        peer.x = np.array([[places[0, axis]], [0.0]])
        peer.P = np.diag([0.03**2, 10.0**2])
        peer.H = np.array([[1.0, 0.0]])
        peer.R = np.array([[0.03**2]])
        peer.F = np.array([[1.0, DT], [0.0, 1.0]])
        # The velocity's walk comes before the move: G*q*G' with G = (dt, 1).
        peer.Q = 0.4**2 * DT * np.array([[DT * DT, DT], [DT, 1.0]])
        peers.append(peer)
    for k, place in enumerate(places[1:], 1):
        track.fix(k * DT, place)
        for axis, peer in enumerate(peers):
            peer.predict()
            peer.update(place[axis])
    p = [peer.x[0, 0] for peer in peers]
    u = np.array([peer.x[1, 0] for peer in peers])
    np.testing.assert_allclose(track.position, p, rtol=1e-9, atol=1e-12)
    assert track.speed == pytest.approx(np.linalg.norm(u), rel=1e-9)
    assert track.speed_variance == pytest.approx(peers[0].P[1, 1], rel=1e-9)
    assert track.heading == pytest.approx(math.atan2(u[1], u[0]), rel=1e-9)


def test_variance_of_the_speed_is_honest():
    """Fixes as noisy as stated, speed as restless as stated: 95 % of errors within 2 sigma."""
    noise = GnssNoise()
    inside, count = 0, 0
    for seed in range(40):
        random = np.random.default_rng(seed)
        walk = math.hypot(noise.acceleration, noise.manoeuvre * 2.0) * math.sqrt(DT)
        speeds = 2.0 + np.cumsum(walk * random.standard_normal(100))
        track = GnssTrack(noise)
        along, place = np.array([1.0, 0.0]), np.zeros(2)
        for k, v in enumerate(speeds):
            place = place + v * DT * along
            track.fix(k * DT, place + noise.position * random.standard_normal(2))
            if k > 10:
                count += 1
                inside += abs(track.speed - v) <= 2 * math.sqrt(track.speed_variance)
    assert 0.90 <= inside / count <= 0.99


def test_readings_are_independent_of_each_other():
    """A second filter with readings has the right covariance; with speeds it has not."""
    noise = GnssNoise()
    walk = math.hypot(noise.acceleration, noise.manoeuvre * 2.0) ** 2 * DT
    inside, count = {'reading': 0, 'speed': 0}, 0
    for seed in range(40):
        random = np.random.default_rng(seed)
        speeds = 2.0 + np.cumsum(math.sqrt(walk) * random.standard_normal(200))
        track, place = GnssTrack(noise), np.zeros(2)
        peers = {'reading': (2.0, 1.0), 'speed': (2.0, 1.0)}
        for k, v in enumerate(speeds):
            place = place + v * DT * np.array([1.0, 0.0])
            track.fix(k * DT, place + noise.position * random.standard_normal(2))
            for kind, (x, p) in peers.items():
                p += walk
                z, r = track.speed, track.speed_variance
                if kind == 'reading':
                    z, r = track.reading, track.reading_variance
                gain = 0.0 if math.isinf(r) else p / (p + r)
                x, p = x + gain * (z - x), (1 - gain) * p
                peers[kind] = x, p
                if k > 20:
                    inside[kind] += abs(x - v) <= 2 * math.sqrt(p)
            count += k > 20
    assert 0.90 <= inside['reading'] / count <= 0.99
    assert inside['speed'] / count < 0.90


@given(
    row=st.integers(15, 95),
    angle=st.floats(0, 2 * math.pi),
    size=st.floats(0.3, 50.0),
    v=st.floats(0.5, 5.0),
)
def test_a_single_jump_is_refused_and_leaves_no_trace(row, angle, size, v):
    jump = size * np.array([math.cos(angle), math.sin(angle)])
    clean, spoilt = GnssTrack(), GnssTrack()
    _, before = drive(clean, [v] * 100, [v] * 100, noise=0.01)
    _, after = drive(spoilt, [v] * 100, [v] * 100, {row: jump}, noise=0.01)
    assert not after[row, 0]
    assert clean.reading_variance < math.inf
    assert spoilt.refused == 1
    assert spoilt.rebased == 0
    assert np.all(after[np.arange(100) != row, 0] == 1)
    # One fix less: what is missing is worth less than the speed between two fixes, which is
    # noisy by 0.01*sqrt(2)/0.1 s = 0.14 m/s: three deviations. A jump believed would be 3 m/s.
    assert np.max(np.abs(after[:, 1] - before[:, 1])) < 0.42
    assert spoilt.distance == pytest.approx(clean.distance, abs=0.05)


@pytest.mark.parametrize('lasting', [2, 3, 10, 80])
@pytest.mark.parametrize('angle', [0.3, 0.3 + math.pi / 2, 0.3 + math.pi])
def test_a_jump_that_stays_is_no_way_travelled(lasting, angle):
    jump = 0.3 * np.array([math.cos(angle), math.sin(angle)])
    track = GnssTrack()
    rows = dict.fromkeys(range(30, 30 + lasting), jump)
    travelled, said = drive(track, [1.2] * 150, [1.2] * 150, rows, noise=0.005)
    assert not said[30, 0]
    # It restarts from there within a second, also at the end of the jump.
    if lasting >= 10:
        assert np.all(said[40 : 30 + lasting, 0] == 1)
        assert track.rebased == 2
    assert np.all(said[40 + lasting :, 0] == 1)
    assert np.max(np.abs(said[20:, 1] - 1.2)) < 0.12
    assert track.distance == pytest.approx(travelled, abs=0.2)


@pytest.mark.parametrize('rate', [5, 10, 20])
def test_a_real_stop_is_followed_while_the_wheels_spin(rate):
    """Within 0.4 s from 2 m/s to standstill, the wheels spinning up to 4 m/s meanwhile."""
    dt = 1.0 / rate
    t = np.arange(0.0, 6.0, dt)
    speeds = np.interp(t, [3.0, 3.4], [2.0, 0.0])
    rims = np.interp(t, [3.0, 3.4], [2.0, 4.0])
    track = GnssTrack()
    _, said = drive(track, speeds, rims, noise=0.01, dt=dt)
    assert np.max(np.abs(said[(t > 2.0) & (t < 3.0), 1] - 2.0)) < 0.2
    # A second after it stands at the latest.
    assert np.max(np.abs(said[t > 4.4 + dt, 1])) < 0.2


def test_wheels_tell_a_change_of_speed_before_the_fixes_do():
    """Hard braking with wheels that roll: the speed has no lag."""
    t = np.arange(0.0, 5.0, DT)
    speeds = np.interp(t, [2.0, 3.0], [8.0, 2.0])
    with_wheels, without = GnssTrack(), GnssTrack()
    _, told = drive(with_wheels, speeds, speeds + 0.0, noise=0.01)
    _, untold = drive(without, speeds, noise=0.01)
    during = (t > 2.0) & (t < 3.0)
    error = np.max(np.abs(told[during, 1] - speeds[during]))
    # Rim speeds are means over the interval, speeds at its end: 0.3 m/s apart at 6 m/s^2.
    assert error < 0.45
    assert error < np.max(np.abs(untold[during, 1] - speeds[during]))


def test_reverse_is_told_by_the_wheels():
    track = GnssTrack()
    # The vehicle points east and backs up to the west.
    drive(track, [1.0] * 50, [-1.0] * 50, heading=math.pi)
    assert track.speed == pytest.approx(-1.0)
    assert abs(track.heading) < 1e-6
    assert track.distance == pytest.approx(-4.9, abs=0.15)


def test_slow_and_standing_is_not_valid():
    track = GnssTrack(min_speed=0.3)
    drive(track, [0.2] * 50, [0.2] * 50, noise=0.005)
    assert not track.valid
    assert math.isinf(track.reading_variance)
    assert track.distance == 0.0
    drive(fast := GnssTrack(min_speed=0.3), [0.5] * 50, [0.5] * 50, noise=0.005)
    assert fast.valid


def test_latency_shifts_the_time_of_measurement():
    """Fixes stamped 0.2 s late on a ramp of 1 m/s^2: the speed is that of its own time."""
    track = GnssTrack(latency=0.2)
    for k in range(60):
        t = 0.1 * k
        track.wheels(t, 1.0 + t)
        measured = t - 0.2
        track.fix(t, [measured + 0.5 * measured**2, 0.0])
    assert track.t == pytest.approx(5.9 - 0.2)
    assert track.speed_t == pytest.approx(5.7 - 0.05)
    assert track.speed == pytest.approx(1.0 + track.speed_t, abs=0.01)


def test_height_counts_on_a_slope():
    # 30 % slope: the way is sqrt(1 + 0.09) longer than on the map.
    track = GnssTrack()
    for k in range(101):
        x = 0.1 * k
        track.fix(0.1 * k, [x, 0.0, 0.3 * x])
    assert track.speed == pytest.approx(math.hypot(1.0, 0.3), rel=1e-3)
    assert track.heading == pytest.approx(0.0)


def test_velocities_alone_are_enough():
    random = np.random.default_rng(5)
    track = GnssTrack()
    for k in range(100):
        wrong = 5.0 if k == 60 else 0.0
        v = np.array([0.0, 3.0 + wrong]) + 0.05 * random.standard_normal(2)
        assert track.velocity(0.1 * k, v, 0.05**2) == (k != 60)
    assert track.speed == pytest.approx(3.0, abs=0.1)
    assert track.heading == pytest.approx(math.pi / 2, abs=0.05)
    # 9.9 s at 3 m/s.
    assert track.distance == pytest.approx(29.7, abs=0.3)


def test_a_long_gap_starts_over_and_keeps_the_distance():
    track = GnssTrack()
    drive(track, [1.0] * 50)
    before = track.distance
    assert track.fix(20.0, [500.0, 500.0])
    assert not track.valid
    assert track.distance == before
    assert track.refused == 0


@pytest.mark.parametrize(
    ('call', 'named'),
    [
        (lambda t: t.fix(9.9, [1.0]), '2 or 3 entries'),
        (lambda t: t.fix(9.9, [1.0, math.nan]), 'position is not finite'),
        (lambda t: t.fix(math.inf, [1.0, 1.0]), 'time of measurement'),
        (lambda t: t.fix(0.5, [1.0, 1.0]), 'time runs backwards'),
        (lambda t: t.fix(9.9, [1.0, 1.0, 1.0]), '3 axes, those before had 2'),
        (lambda t: t.velocity(9.9, [1.0, 1.0], 0.0), 'variance of velocity'),
        (lambda t: t.velocity(9.9, [math.inf, 1.0], 0.1), 'velocity is not finite'),
        (lambda t: t.wheels(9.9, math.nan), 'rim speed nan'),
    ],
)
def test_what_is_not_usable_is_named_and_not_taken_in(call, named):
    track, untouched = GnssTrack(), GnssTrack()
    for each in (track, untouched):
        drive(each, [1.0] * 20)
    with pytest.raises(ValueError, match=named):
        call(track)
    assert (track.t, track.speed, track.distance) == (
        untouched.t,
        untouched.speed,
        untouched.distance,
    )


@pytest.mark.parametrize(
    ('make', 'named'),
    [
        (lambda: GnssTrack(latency=-0.1), 'latency'),
        (lambda: GnssTrack(gate=0.0), 'gate'),
        (lambda: GnssTrack(settling=math.nan), 'settling'),
        (lambda: GnssTrack(min_speed=0.0), 'min_speed'),
        (lambda: GnssNoise(manoeuvre=0.0), 'manoeuvre'),
    ],
)
def test_parameters_out_of_range_are_named(make, named):
    with pytest.raises(ValueError, match=named):
        make()


def test_rim_travel_by_hand():
    travel = RimTravel(memory=3.0)
    assert math.isnan(travel.at(0.0))
    # 1 m/s for 1 s, then rising to 3 m/s over 2 s: 1 m and 4 m.
    travel.add(0.0, 1.0)
    travel.add(1.0, 1.0)
    travel.add(3.0, 3.0)
    assert travel.at(1.0) - travel.at(0.0) == pytest.approx(1.0)
    assert travel.at(3.0) - travel.at(1.0) == pytest.approx(4.0)
    # Extrapolated for a short time, then NaN; also NaN long before.
    assert travel.at(3.2) - travel.at(3.0) == pytest.approx(0.6)
    assert math.isnan(travel.at(4.0))
    travel.add(3.5, 3.0)
    assert math.isnan(travel.at(0.2))
    # A clock that was set back: it begins anew.
    travel.add(0.0, 1.0)
    assert math.isnan(travel.at(3.0))
