"""Predict and update steps of the slip filter.

State for n wheels: speed v, drawbar d (external force without motion resistance: drawbar pull,
grade, air drag), then for each wheel the logarithms of three factors on the nominal soil:
strength, shear deformation modulus K, and sinkage modulus k. Shaft torque and tachometer give the
moment M of the soil on each wheel, the contact form gives its motion resistance R. Prediction:

    v' = (sum_j (M_j/r_j - R_j) - d)/m.

Updates: M_j of every wheel, which the contact form gives as a function of slip, soil, wheel load
(with load transfer) and rut; and v from a radar or a satellite receiver.

A change of soil appears in M before it appears in v: within 50 ms a wheel speeds up to the slip of
its torque on the new soil, while v has hardly changed. If the innovations of a wheel's moment are
large for several readings, its moment is not used over one contact length. Then its soil factors
restart from the nominal soil with the variance of a changed soil.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from traction_controller.estimation.kalman import (
    linearise,
    optimal_gain,
    reset_entry,
    sigma_points,
    update,
)
from traction_controller.estimation.wheel_contact import quasi_static
from traction_model.contact.contact import MIN_TRANSIT_SPEED
from traction_model.kernel import kernel
from traction_model.slip import is_valid
from traction_model.soil.rut import press_rut
from traction_model.vehicle.load_transfer import load_moment, wheel_load
from traction_model.vehicle.vehicle import GRAVITY
from traction_model.vehicle.wheel import (
    FRICTION,
    INERTIA,
    POSITION,
    RADIUS,
    STATIC_LOAD,
    TRACK,
    WIDTH,
)

Array = NDArray[np.float64]

# State: speed, drawbar, then three factors for each wheel.
SPEED, DRAWBAR, FIRST_WHEEL = range(3)
PER_WHEEL = 3

# The three: logarithms of the factors on the nominal soil.
STRENGTH, SHEAR_MODULUS, SINKAGE_MODULUS = range(PER_WHEEL)

WHEEL_MEMORY = np.dtype(
    [
        # Wheel speed estimated from tachometer pulses, rad/s, and its variance.
        ('omega', float),
        ('omega_variance', float),
        # Smoothed wheel speed, rad/s, and drive torque, N·m.
        ('smooth_omega', float),
        ('smooth_drive', float),
        # Moment of the soil, N·m; load, N; sinkage, m; shear displacement left in the rut, m.
        ('moment', float),
        ('load', float),
        ('sinkage', float),
        ('shear', float),
        # Motion resistance, N; its slopes over v and over the three logarithms; variance of the
        # residual about that line, N^2.
        ('resistance', float),
        ('resistance_by_speed', float),
        ('resistance_by_strength', float),
        ('resistance_by_shear_modulus', float),
        ('resistance_by_sinkage_modulus', float),
        ('resistance_rest', float),
        # Slope of moment over v, N*s, and of sinkage over ln(k), m.
        ('moment_slope', float),
        ('sinkage_slope', float),
        # Mean normalised innovation of the moment.
        ('mean_innovation', float),
        # Distance since standstill up to which its moment is not used, m; -1: soil never changed.
        ('held_until', float),
        # Filter of the counted angle: angle from pulse to pulse, rad, 0 while none are counted;
        # angle ahead of the count, rad; its variance, rad^2; its covariance with the wheel speed,
        # rad^2/s.
        ('pulse', float),
        ('angle_ahead', float),
        ('angle_variance', float),
        ('angle_omega_covariance', float),
        # Ground speed at the wheel beyond that of the vehicle, m/s: in turns.
        ('turn', float),
    ],
    align=True,
)
"""Memory of each wheel beside the filter's state, SI units."""

VEHICLE_MEMORY = np.dtype(
    [
        # Time of the newest reading of the wheels, s; place along the path and distance since
        # standstill, m.
        ('time', float),
        ('place', float),
        ('travelled', float),
        # Acceleration of the last step and smoothed, m/s^2.
        ('acceleration', float),
        ('smooth_acceleration', float),
        # Time of the last change of soil, s.
        ('soil_changed_at', float),
        # Smoothed gross traction of all wheels, N.
        ('smooth_traction', float),
        # Time of the newest accepted measured speed, s, and mean normalised innovation.
        ('speed_time', float),
        ('mean_speed_innovation', float),
        # Integral of the acceleration, m/s.
        ('reckoned', float),
    ],
    align=True,
)
"""Memory of the vehicle beside the filter's state, SI units."""


class Noise(NamedTuple):
    """Noise of the slip filter, as its steps need it.

    Attributes
    ----------
    speed, drawbar : float
        Random walks, m/s per sqrt(s) and N per sqrt(s).
    moment : float
        Standard deviation of a moment over radius and static load, dimensionless.
    slip : float
        Standard deviation of the slip at which a moment is reached, dimensionless.
    wheel_speed : float
        Standard deviation of a reading of an ideal tachometer, rad/s.
    wheel_acceleration : float
        Random walk of the wheel speed between pulses, as a share of it, 1/sqrt(s).
    min_speed : float
        Speed below which slip is not used, m/s.
    """

    speed: float
    drawbar: float
    moment: float
    slip: float
    wheel_speed: float
    wheel_acceleration: float
    min_speed: float


class WheelSample(NamedTuple):
    """Reading of all wheels, n of them.

    Attributes
    ----------
    omega, torque : ndarray, shape (n,)
        Wheel speeds, rad/s, and shaft torques, N·m, forward positive.
    pulse : ndarray, shape (n,)
        Angle from pulse to pulse of each tachometer, rad; 0 where it does not count.
    counted : ndarray, shape (n,)
        Angle that each tachometer has counted in this reading, rad, forward positive.
    turn : ndarray, shape (n,)
        Ground speed at each wheel beyond that of the vehicle, m/s.
    """

    omega: Array
    torque: Array
    pulse: Array
    counted: Array
    turn: Array


class Body(NamedTuple):
    """Constant properties of vehicle and soil, n wheels.

    Attributes
    ----------
    wheels : ndarray, shape (n, 7)
        Packed wheels, SI units.
    soils : ndarray, shape (n, 17)
        Packed nominal soil, for each wheel, SI units.
    load_distribution : ndarray, shape (n, 2)
        Load of a wheel, N, per N of weight and per N·m of load transfer moment.
    drift, changed : ndarray, shape (3, 3)
        Covariance of a wheel's three factors: growth per second, 1/s, and value after a change
        of soil, dimensionless.
    mass, cg_x, cg_height, hitch_height : float
        Mass, kg; positions of centre of gravity and hitch, m.
    """

    wheels: Array
    soils: Array
    load_distribution: Array
    drift: Array
    changed: Array
    mass: float
    cg_x: float
    cg_height: float
    hitch_height: float


# Time constant of the filter of moments, s, and of acceleration for load transfer.
FILTER = 0.04
TRANSFER_FILTER = 0.1
# Drawbar follows gross traction, since draft grows with speed. Standard deviation of its change,
# as a share of the change of gross traction over this time constant, s.
DRAWBAR_SHARE, DRAWBAR_FILTER = 0.25, 0.3
# Contact becomes quasi-static some distance after a start and after a change of soil. Extra
# standard deviation at first, as a multiple, and distance over which it decays, over the radius.
START_EXTRA, START_LENGTH = 100.0, 0.6
CHANGE_EXTRA, CHANGE_LENGTH = 3.0, 0.4
# Extra standard deviation on soil other than the nominal one, as a multiple.
OFF_NOMINAL = 1.0
# A second change within so many radii counts as part of the first: the estimated factors are kept.
AGAIN = 5.0
# Mean normalised innovation of a wheel: weight of the newest; standard deviations of moment and
# slip in it (of single readings, without errors that last longer); mean above which the soil
# counts as changed, and mean above which the variance of the moment grows.
INNOVATION_SHARE = 0.2
INNOVATION_MOMENT, INNOVATION_SLIP = 0.01, 0.015
CHANGE_INNOVATION = 2.5
LARGE_INNOVATION = 2.5
# In turns side forces take a part of the strength of the soil. Difference of a wheel's ground
# speed from that of the vehicle, as a share of it, at which the variance of moments is twice that
# of a straight line.
CORNERING = 0.03
# Smaller random walk of the drawbar after a change of soil: share, and time constant, s.
STEADY_DRAWBAR, STEADY_TIME = 0.3, 1.5
# Counted pulses: wheel speed, rad/s, below which its random walk stays constant; allowed
# difference of the expected angle from the middle of the pulse, in half pulses; growth of the
# variance of the speed, as a share of (excess over one period)^2.
MIN_WALKING, COUNT_SLACK, UNEXPECTED_SPEED = 1.0, 1.2, 0.05
# Change of the angle from pulse to pulse, as a share, up to which the count goes on.
SAME_PULSE = 0.01
# Smallest load of a wheel over its static load, and largest drawbar over the weight.
MIN_LOAD, MAX_DRAWBAR = 0.2, 0.5


@kernel
def reset_soil(x, p, wheel, changed, keep):
    """Reset the soil factors of a wheel and their covariance, in place.

    Parameters
    ----------
    x : ndarray, shape (2 + 3n,)
        State: m/s, N, logarithms.
    p : ndarray, shape (2 + 3n, 2 + 3n)
        Its covariance, in products of these units.
    wheel : int
        Index of the wheel.
    changed : ndarray, shape (3, 3)
        Covariance of the factors, dimensionless.
    keep : bool
        True: keep the factors and reset only their covariance. False: nominal soil.
    """
    first = FIRST_WHEEL + PER_WHEEL * wheel
    for a in range(PER_WHEEL):
        if not keep:
            x[first + a] = 0.0
        reset_entry(p, first + a, 0.0)
    for a in range(PER_WHEEL):
        for b in range(PER_WHEEL):
            p[first + a, first + b] = changed[a, b]


@kernel
def start_count(kept, pulse, omega, noise):
    """Initialise the angle behind a tachometer's pulses, in place.

    Parameters
    ----------
    kept : record
        Record of `WHEEL_MEMORY`, SI units.
    pulse : float
        Angle from pulse to pulse, rad; 0: none are counted.
    omega : float
        Wheel speed, rad/s.
    noise : Noise
        SI units.
    """
    kept.pulse = pulse
    kept.omega = omega
    kept.omega_variance = noise.wheel_speed**2
    if pulse > 0.0:
        # The first count has an unknown period, so it gives the angle but not the speed.
        kept.angle_ahead = pulse / 2.0
        kept.angle_variance = pulse**2 / 12.0
        kept.angle_omega_covariance = 0.0
        kept.omega_variance = 1.0 + (0.5 * omega) ** 2


@kernel
def count_pulses(kept, counted, dt, noise):
    """Estimate wheel angle and speed from counted tachometer pulses, in place.

    The true angle lies between the counted angle and one pulse more.

    Parameters
    ----------
    kept : record
        Record of `WHEEL_MEMORY`, SI units.
    counted : float
        Angle counted since the last reading, rad.
    dt : float
        Time since the last reading, s, above 0.
    noise : Noise
        SI units.
    """
    pulse = kept.pulse
    kept.angle_ahead += kept.omega * dt - counted
    kept.angle_variance += dt * (2.0 * kept.angle_omega_covariance + dt * kept.omega_variance)
    kept.angle_omega_covariance += dt * kept.omega_variance
    walk = noise.wheel_acceleration * max(abs(kept.omega), MIN_WALKING)
    kept.omega_variance += walk**2 * dt
    innovation = pulse / 2.0 - kept.angle_ahead
    # The error of a count is bounded by a pulse: a larger difference is a change of speed.
    excess = abs(innovation) - COUNT_SLACK * pulse / 2.0
    if excess > 0.0:
        kept.omega_variance += UNEXPECTED_SPEED * (excess / dt) ** 2
    # Variance of a uniform distribution over a pulse: pulse^2/12.
    total = kept.angle_variance + pulse**2 / 12.0
    of_angle, of_omega = kept.angle_variance / total, kept.angle_omega_covariance / total
    kept.angle_ahead += of_angle * innovation
    kept.omega += of_omega * innovation
    kept.omega_variance -= of_omega * kept.angle_omega_covariance
    kept.angle_omega_covariance *= 1.0 - of_angle
    kept.angle_variance *= 1.0 - of_angle


@kernel
def reset_curve(kept):
    """Reset the results of the contact form for a wheel at standstill or without valid slip.

    Parameters
    ----------
    kept : record
        Record of `WHEEL_MEMORY`, SI units.
    """
    kept.resistance = 0.0
    kept.resistance_by_speed = 0.0
    kept.resistance_by_strength = 0.0
    kept.resistance_by_shear_modulus = 0.0
    kept.resistance_by_sinkage_modulus = 0.0
    kept.resistance_rest = 0.0
    kept.moment_slope = 0.0
    kept.sinkage_slope = 0.0


@kernel
def initialise(t, sample, x, p, wheel_memory, vehicle_memory, body, noise):
    """Initialise from the first reading of the wheels, in place.

    Parameters
    ----------
    t : float
        Time, s.
    sample : WheelSample
        The reading, SI units.
    x, p : ndarray
        State and covariance in SI units, see `update_wheels`.
    wheel_memory, vehicle_memory : ndarray
        Memory beside state and covariance, SI units, see `update_wheels`.
    body : Body
        SI units.
    noise : Noise
        SI units.
    """
    trip = vehicle_memory[0]
    trip.time = t
    omega, torque = sample.omega, sample.torque
    rims = np.empty(omega.size)
    for j in range(omega.size):
        wheel, kept = body.wheels[j], wheel_memory[j]
        rims[j] = wheel[RADIUS] * omega[j]
        start_count(kept, sample.pulse[j], omega[j], noise)
        kept.smooth_omega = omega[j]
        kept.smooth_drive = torque[j] - wheel[FRICTION] * omega[j]
        kept.moment = kept.smooth_drive
        kept.load = wheel[STATIC_LOAD]
        trip.smooth_traction += kept.moment / wheel[RADIUS]
    # Speed of rolling with a standard deviation of half of it: the wheels may slip already.
    rim = float(np.median(rims))
    x[SPEED] = rim
    reset_entry(p, SPEED, 1.0 + (0.5 * rim) ** 2)


@kernel
def predict(t, sample, x, p, wheel_memory, vehicle_memory, ruts, body, noise):
    """Predict the state at the next reading of the wheels, in place.

    Parameters
    ----------
    t : float
        Time, s, after that of `vehicle_memory`.
    sample : WheelSample
        The reading, SI units.
    x, p : ndarray
        State and covariance in SI units, see `update_wheels`.
    wheel_memory, vehicle_memory : ndarray
        Memory beside state and covariance, SI units, see `update_wheels`.
    ruts : Ruts
        Ruts of the wheels, extended by this step.
    body : Body
        SI units.
    noise : Noise
        SI units.
    """
    omega, torque = sample.omega, sample.torque
    n, m = omega.size, x.size
    mass = body.mass
    trip = vehicle_memory[0]
    dt = t - trip.time
    share = 1.0 - math.exp(-dt / FILTER)
    acceleration = -x[DRAWBAR]
    thrust = 0.0
    slope = np.zeros(m)
    slope[DRAWBAR] = -1.0
    rest = 0.0
    weight = mass * GRAVITY
    drawbar = max(-MAX_DRAWBAR * weight, min(MAX_DRAWBAR * weight, x[DRAWBAR]))
    wheel_moment = 0.0
    for j in range(n):
        wheel, kept = body.wheels[j], wheel_memory[j]
        before = kept.omega
        kept.turn = sample.turn[j]
        pulse = sample.pulse[j]
        if pulse == 0.0 or abs(pulse - kept.pulse) > SAME_PULSE * pulse:
            start_count(kept, pulse, omega[j] if pulse == 0.0 else before, noise)
        kept.pulse = pulse
        if pulse > 0.0:
            count_pulses(kept, sample.counted[j], dt, noise)
        drive = torque[j] - wheel[FRICTION] * kept.omega
        # The same filter on drive torque and wheel acceleration, so that their difference
        # M = T - I*d(omega)/dt is the filtered moment.
        spin_up = share / dt * (kept.omega - kept.smooth_omega)
        kept.smooth_omega += share * (kept.omega - kept.smooth_omega)
        kept.smooth_drive += share * (drive - kept.smooth_drive)
        kept.moment = kept.smooth_drive - wheel[INERTIA] * spin_up
        # The impulse needs no filter: errors of the tachometer cancel in the sum over readings.
        impulse = (drive - wheel[INERTIA] * (kept.omega - before) / dt) / wheel[RADIUS]
        acceleration += impulse - kept.resistance
        thrust += kept.moment / wheel[RADIUS]
        slope[SPEED] -= kept.resistance_by_speed
        first = FIRST_WHEEL + PER_WHEEL * j
        slope[first + STRENGTH] = -kept.resistance_by_strength
        slope[first + SHEAR_MODULUS] = -kept.resistance_by_shear_modulus
        slope[first + SINKAGE_MODULUS] = -kept.resistance_by_sinkage_modulus
        rest += kept.resistance_rest
        wheel_moment += wheel[RADIUS] * kept.resistance
    acceleration /= mass
    slope /= mass
    v = x[SPEED]
    x[SPEED] += acceleration * dt
    # P = F*P*F', where F is the identity except for the row of v: first rows, then columns.
    row = np.zeros(m)
    for a in range(m):
        gained = 0.0
        for b in range(m):
            gained += slope[b] * p[b, a]
        row[a] = p[SPEED, a] + dt * gained
    corner = row[SPEED]
    for b in range(m):
        corner += dt * slope[b] * row[b]
    for a in range(m):
        p[SPEED, a] = row[a]
        p[a, SPEED] = row[a]
    p[SPEED, SPEED] = corner + noise.speed**2 * dt + rest * (dt / mass) ** 2
    steady = math.exp(-(t - trip.soil_changed_at) / STEADY_TIME)
    p[DRAWBAR, DRAWBAR] += (noise.drawbar * (1.0 - (1.0 - STEADY_DRAWBAR) * steady)) ** 2 * dt
    share = 1.0 - math.exp(-dt / DRAWBAR_FILTER)
    change = thrust - trip.smooth_traction
    trip.smooth_traction += share * change
    p[DRAWBAR, DRAWBAR] += share * (DRAWBAR_SHARE * change) ** 2
    for j in range(n):
        first = FIRST_WHEEL + PER_WHEEL * j
        for a in range(PER_WHEEL):
            for b in range(PER_WHEEL):
                p[first + a, first + b] += body.drift[a, b] * dt

    moved = 0.5 * (v + x[SPEED]) * dt
    place = trip.place
    trip.place += moved
    trip.travelled += abs(moved)
    trip.acceleration = acceleration
    # No vehicle on wheels changes its speed faster.
    trip.reckoned += max(-GRAVITY, min(GRAVITY, acceleration)) * dt
    share = 1.0 - math.exp(-dt / TRANSFER_FILTER)
    trip.smooth_acceleration += share * (acceleration - trip.smooth_acceleration)
    trip.time = t
    moment = load_moment(
        weight, body.cg_x, body.cg_height, body.hitch_height, drawbar,
        mass * trip.smooth_acceleration, wheel_moment,
    )  # fmt: skip
    for j in range(n):
        wheel, kept = body.wheels[j], wheel_memory[j]
        load = wheel_load(body.load_distribution[j], weight, moment)
        kept.load = max(MIN_LOAD * wheel[STATIC_LOAD], load)
        if kept.sinkage > 0.0:
            x_from = place + wheel[POSITION]
            press_rut(
                x_from, x_from + moved, kept.sinkage, kept.shear, wheel[WIDTH],
                int(wheel[TRACK]), ruts,
            )  # fmt: skip


@kernel
def update_moments(method, x, p, wheel_memory, vehicle_memory, ruts, body, noise):
    """Update with the moment of every wheel with a valid slip, in place.

    Parameters
    ----------
    method : int
        A `traction_controller.estimation.kalman.Method`.
    x, p : ndarray
        State and covariance in SI units, see `update_wheels`.
    wheel_memory, vehicle_memory : ndarray
        Memory beside state and covariance, SI units, see `update_wheels`.
    ruts : Ruts
        Ruts of the wheels.
    body : Body
        SI units.
    noise : Noise
        SI units.
    """
    k = 1 + PER_WHEEL
    entries = np.empty(k, dtype=np.int64)
    steps = np.empty(k)
    root = np.zeros((k, k))
    points = np.empty((1 + 2 * k, k))
    moments = np.empty(1 + 2 * k)
    resistances = np.empty(1 + 2 * k)
    sinkages = np.empty(1 + 2 * k)
    slope = np.empty(k)
    h = np.zeros(x.size)
    gain = np.empty(x.size)
    soil = np.empty((1, body.soils.shape[1]))
    trip = vehicle_memory[0]
    travelled = trip.travelled
    widest = 0.0
    for j in range(wheel_memory.shape[0]):
        widest = max(widest, abs(wheel_memory[j].turn))
    cornering = 1.0 + (widest / (CORNERING * max(abs(x[SPEED]), noise.min_speed))) ** 2
    for j in range(wheel_memory.shape[0]):
        wheel, kept = body.wheels[j], wheel_memory[j]
        radius = wheel[RADIUS]
        omega = kept.omega
        v, rim = x[SPEED] + kept.turn, radius * omega
        if not is_valid(v, rim, noise.min_speed) or v * rim < 0.0:
            reset_curve(kept)
            continue
        fastest = max(abs(v), abs(rim))
        heading = 1.0 if v + rim >= 0.0 else -1.0
        first = FIRST_WHEEL + PER_WHEEL * j
        entries[0] = SPEED
        # Towards more slip on firmer soil, where the curvature is smallest.
        steps[0] = -0.01 * heading * fastest
        for a in range(PER_WHEEL):
            entries[1 + a] = first + a
            steps[1 + a] = 0.1
        steps[1 + SINKAGE_MODULUS] = -0.1
        count = sigma_points(method, x, p, entries, steps, root, points)
        place = trip.place + wheel[POSITION]
        guess = kept.sinkage
        left = 0.0
        for i in range(count):
            # Not past standstill, where slip and moment change sign.
            speed = heading * max(heading * (points[i, 0] + kept.turn), MIN_TRANSIT_SPEED)
            moment, resistance, _, z, shear = quasi_static(
                speed, omega, kept.load, place, (points[i, 1], points[i, 2], points[i, 3]),
                body.soils[j], wheel, ruts, guess, soil,
            )  # fmt: skip
            moments[i], resistances[i], sinkages[i] = moment, resistance, z
            if i == 0:
                guess, left = z, shear
        kept.sinkage, kept.shear = sinkages[0], left
        resistance, resistance_rest = linearise(method, resistances, steps, root, slope)
        kept.resistance, kept.resistance_rest = resistance, resistance_rest
        kept.resistance_by_speed = slope[0]
        kept.resistance_by_strength = slope[1 + STRENGTH]
        kept.resistance_by_shear_modulus = slope[1 + SHEAR_MODULUS]
        kept.resistance_by_sinkage_modulus = slope[1 + SINKAGE_MODULUS]
        linearise(method, sinkages, steps, root, slope)
        kept.sinkage_slope = slope[1 + SINKAGE_MODULUS]
        expected, rest = linearise(method, moments, steps, root, slope)
        kept.moment_slope = slope[0]

        h[:] = 0.0
        for a in range(k):
            h[entries[a]] = slope[a]
        per_slip = slope[0] * fastest
        # Variance of the slip from the error of the wheel speed, with counted pulses only.
        blurred = kept.pulse > 0.0
        by_pulses = (per_slip * radius / fastest) ** 2 * kept.omega_variance if blurred else 0.0
        innovation = kept.moment - expected
        unsettled = 1.0 + START_EXTRA * math.exp(-travelled / (START_LENGTH * radius))
        past = travelled - kept.held_until
        changing = 1.0 + CHANGE_EXTRA * math.exp(-max(past, 0.0) / (CHANGE_LENGTH * radius))
        changing += OFF_NOMINAL if kept.held_until > 0.0 else 0.0
        unit = radius * wheel[STATIC_LOAD]
        own = (INNOVATION_MOMENT * unit) ** 2 + (INNOVATION_SLIP * per_slip) ** 2 + by_pulses
        seen = own * cornering * (unsettled * changing) ** 2 + rest
        for a in range(k):
            for b in range(k):
                seen += slope[a] * p[entries[a], entries[b]] * slope[b]
        if past > 0.0 and unsettled < 1.1:
            normalised = innovation / math.sqrt(seen)
            kept.mean_innovation += INNOVATION_SHARE * (normalised - kept.mean_innovation)
        else:
            kept.mean_innovation = 0.0
        if abs(kept.mean_innovation) > CHANGE_INNOVATION:
            kept.mean_innovation = 0.0
            reset_soil(x, p, j, body.changed, kept.held_until > 0.0 and past < AGAIN * radius)
            trip.soil_changed_at = trip.time
            cosine = max(-1.0, 1.0 - kept.sinkage / radius)
            kept.held_until = travelled + radius * math.acos(cosine)
        if travelled <= kept.held_until:
            continue
        variance = (noise.moment * unit) ** 2 + (noise.slip * per_slip) ** 2 + by_pulses + rest
        variance *= (
            cornering
            * (unsettled * changing) ** 2
            * (1.0 + (kept.mean_innovation / LARGE_INNOVATION) ** 4)
        )
        optimal_gain(p, h, variance, gain)
        update(x, p, h, gain, innovation, variance)


@kernel
def update_wheels(method, t, sample, x, p, wheel_memory, vehicle_memory, ruts, body, noise):
    """Predict, and update with a reading of all wheels after the first, in place.

    Parameters
    ----------
    method : int
        A `traction_controller.estimation.kalman.Method`.
    t : float
        Time, s, after that of `vehicle_memory`.
    sample : WheelSample
        The reading, SI units.
    x : ndarray, shape (2 + 3n,)
        State: m/s, N, logarithms.
    p : ndarray, shape (2 + 3n, 2 + 3n)
        Its covariance, in products of these units.
    wheel_memory : ndarray of `WHEEL_MEMORY`, shape (n,)
        Memory of each wheel, SI units.
    vehicle_memory : ndarray of `VEHICLE_MEMORY`, shape (1,)
        Memory of the vehicle, SI units.
    ruts : Ruts
        Ruts of the wheels.
    body : Body
        SI units.
    noise : Noise
        SI units.
    """
    predict(t, sample, x, p, wheel_memory, vehicle_memory, ruts, body, noise)
    update_moments(method, x, p, wheel_memory, vehicle_memory, ruts, body, noise)


@kernel
def update_acceleration(x, p, wheel_memory, vehicle_memory, body, acceleration, variance):
    """Update with a measured acceleration of the vehicle, after `update_wheels`, in place.

    Parameters
    ----------
    x, p : ndarray
        State and covariance in SI units, see `update_wheels`.
    wheel_memory, vehicle_memory : ndarray
        Memory beside state and covariance, SI units, see `update_wheels`.
    body : Body
        SI units.
    acceleration : float
        Measured acceleration, m/s^2, forward positive.
    variance : float
        Its variance, m^2/s^4, above 0.
    """
    h = np.zeros(x.size)
    gain = np.empty(x.size)
    h[DRAWBAR] = -1.0 / body.mass
    for j in range(wheel_memory.shape[0]):
        kept = wheel_memory[j]
        first = FIRST_WHEEL + PER_WHEEL * j
        h[SPEED] -= kept.resistance_by_speed / body.mass
        h[first + STRENGTH] = -kept.resistance_by_strength / body.mass
        h[first + SHEAR_MODULUS] = -kept.resistance_by_shear_modulus / body.mass
        h[first + SINKAGE_MODULUS] = -kept.resistance_by_sinkage_modulus / body.mass
    optimal_gain(p, h, variance, gain)
    update(x, p, h, gain, acceleration - vehicle_memory[0].acceleration, variance)


@kernel
def update_speed(x, p, v, variance):
    """Update with a measured speed over ground, in place.

    Parameters
    ----------
    x : ndarray, shape (m,)
        State, speed first, m/s.
    p : ndarray, shape (m, m)
        Its covariance, in products of the state's units.
    v : float
        Measured speed, m/s, forward positive.
    variance : float
        Its variance, m^2/s^2, above 0.
    """
    h = np.zeros(x.size)
    h[SPEED] = 1.0
    gain = np.empty(x.size)
    optimal_gain(p, h, variance, gain)
    update(x, p, h, gain, v - x[SPEED], variance)
