"""The same equations written for other solvers, with nothing taken from traction_model.

State: speed m/s, then wheel speeds rad/s, sinkages m and sinkage rates m/s of all wheels. Each
right-hand side is written as its language runs it fastest: plain floats for the closed form,
NumPy over all wheels and points for the stress integrals.
"""

import json
import math
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy
from problem import SAMPLE_TIME, Array, Problem
from scipy.integrate import solve_ivp

GRAVITY = 9.81
FADE = 0.05  # m/s below which slip, resistance and drawbar fade out

Motion = Callable[[float, Array], list[float] | Array]

OCTAVE_SOURCE = Path(__file__).with_name('plate_wheel.m')


def closed_form(problem: Problem) -> Motion:
    """Bekker's resistance and the paper's thrust (21), sinkage a state, for any wheels."""
    soil, drawbar = problem.soil, problem.drawbar
    k_c, k_phi, n = soil.cohesive_modulus, soil.frictional_modulus, soil.sinkage_exponent
    c, tan_phi = soil.cohesion, math.tan(soil.friction_angle)
    K, D = soil.shear_deformation_modulus, soil.damping
    torques = problem.torque.tolist()
    last = len(torques) - 2
    wheels = [
        (wheel.radius, wheel.width, wheel.inertia, k_c / wheel.width + k_phi)
        for wheel in problem.vehicle.wheels
    ]
    mass = problem.vehicle.mass
    count = len(wheels)
    loads = load_balance(problem)
    carried = (loads(0.0, 0.0, 0.0) / GRAVITY).tolist()

    def motion(t: float, y: Array) -> list[float]:
        y = y.tolist()
        v = y[0]
        k = min(int(t / SAMPLE_TIME), last)
        share = t / SAMPLE_TIME - k
        before, after = torques[k], torques[k + 1]
        fade = max(-1.0, min(1.0, v / FADE))
        net_force = turning = 0.0
        spin, upward = [], []
        for j in range(count):
            r, b, J, stiffness = wheels[j]
            omega, z, z_rate = y[1 + j], y[1 + count + j], y[1 + 2 * count + j]
            if z > 0.0:
                length = math.sqrt((2.0 * r - z) * z)
                area = b * length
                N = area * (stiffness * z**n + D * max(z_rate, 0.0))
                rim = r * omega
                slip = (rim - v) / max(abs(rim), abs(v), FADE)
                u = min(1.0, abs(slip)) * length / K
                kappa = -math.expm1(-u) / u if u > 0.0 else 1.0
                F = math.copysign((c * area + N * tan_phi) * (1.0 - kappa), slip)
                R = fade * N * z / ((n + 1.0) * length)
            else:
                N = F = R = 0.0
            torque = before[j] + share * (after[j] - before[j])
            net_force += F - R
            turning += torque - r * (F - R)
            spin.append((torque - r * F) / J)
            upward.append(N)
        ramp = min(1.0, t / drawbar.ramp) if drawbar.ramp else 1.0
        pull = fade * ramp * (drawbar.pull + drawbar.pull_per_speed * abs(v))
        acceleration = (net_force - pull) / mass
        if count == 1:
            lift = [GRAVITY - upward[0] / carried[0]]
        else:
            load = loads(acceleration, pull, turning)
            lift = [(load[j] - upward[j]) / carried[j] for j in range(count)]
        return [acceleration, *spin, *y[1 + 2 * count :], *lift]

    return motion


def load_balance(problem: Problem) -> Callable[[float, float, float], Array]:
    """Loads on the wheels of one axle, or of two from the moments about the rear contact."""
    vehicle = problem.vehicle
    weight = vehicle.mass * GRAVITY
    x = vehicle.wheel_positions
    x_cg, height = vehicle.centre_of_gravity
    front = x == x.max()
    single = front.all()

    def loads(acceleration: float, pull: float, turning: float) -> Array:
        if single:
            return np.full(x.size, weight / x.size)
        moment = weight * x_cg - height * vehicle.mass * acceleration
        moment -= vehicle.hitch_height * pull + turning
        ahead = moment / (x.max() - x.min())
        return np.where(front, ahead / front.sum(), (weight - ahead) / (~front).sum())

    return loads


def stress_integrals(problem: Problem, points: int = 24) -> Motion:
    """The contact form: stresses at so many points of each arc, sinkage a state.

    For wheels that roll forward faster than `FADE` on fresh soil that does not spring back.
    """
    soil, drawbar, vehicle = problem.soil, problem.drawbar, problem.vehicle
    r = np.array([wheel.radius for wheel in vehicle.wheels])
    b = np.array([wheel.width for wheel in vehicle.wheels])
    J = np.array([wheel.inertia for wheel in vehicle.wheels])
    n, K, D = soil.sinkage_exponent, soil.shear_deformation_modulus, soil.damping
    stiffness = (soil.cohesive_modulus / b + soil.frictional_modulus)[:, None]
    tan_phi = math.tan(soil.friction_angle)
    nodes, weights = np.polynomial.legendre.leggauss(points // 2)
    nodes, weights = (nodes + 1.0) / 2.0, weights / 2.0
    # Half of the points ahead of where the rim overtakes the ground, half behind; in both they
    # crowd towards the front.
    behind = np.repeat([False, True], points // 2)
    fraction = np.tile(nodes**2, 2)
    weight = np.tile(2.0 * weights * nodes, 2)
    direction = np.where(behind, 1.0, -1.0)
    loads = load_balance(problem)
    carried = loads(0.0, 0.0, 0.0) / GRAVITY
    count = len(r)
    torques = problem.torque
    last = len(torques) - 2

    def motion(t: float, y: Array) -> Array:
        v, omega = y[0], y[1 : 1 + count]
        z, z_rate = y[1 + count : 1 + 2 * count], y[1 + 2 * count :]
        rim = r * omega
        entry = np.arccos(np.maximum(0.0, 1.0 - np.maximum(z, 0.0) / r))
        leaving = np.clip(-np.arctan(z_rate / v), -entry, entry)
        turn = np.where(rim > v, np.arccos(np.minimum(1.0, v / np.maximum(rim, v))), leaving)
        turn = np.clip(turn, leaving, entry)
        front = np.where(behind, turn[:, None], entry[:, None])
        span = front - np.where(behind, leaving[:, None], turn[:, None])
        theta = front - span * fraction
        cos, sin = np.cos(theta), np.sin(theta)
        sunk = z[:, None] - r[:, None] * (1.0 - cos)
        sigma = stiffness * np.maximum(sunk, 0.0) ** n
        sigma += D * np.maximum(z_rate[:, None] + rim[:, None] * sin, 0.0)

        def swept(s, sin_s, cos_s, rim):
            return rim * (s + sin_s * cos_s) / 2.0 - v * sin_s

        whole = swept(entry, np.sin(entry), np.cos(entry), rim)[:, None]
        turned = swept(turn, np.sin(turn), np.cos(turn), rim)[:, None]
        here = swept(theta, sin, cos, rim[:, None])
        path = np.where(behind, np.abs(whole - turned) + np.abs(turned - here), whole - here)
        shear = direction * (soil.cohesion + sigma * tan_phi)
        shear *= -np.expm1(-np.abs(path) * r[:, None] / (v * K))
        area = span * weight * cos * (b * r)[:, None]
        N = (sigma * area).sum(axis=1)
        R = (sigma * sin * area).sum(axis=1)
        net = (shear * area).sum(axis=1)
        M = r * ((shear * cos * area).sum(axis=1) + R)

        k = min(int(t / SAMPLE_TIME), last)
        torque = torques[k] + (t / SAMPLE_TIME - k) * (torques[k + 1] - torques[k])
        ramp = min(1.0, t / drawbar.ramp) if drawbar.ramp else 1.0
        pull = ramp * (drawbar.pull + drawbar.pull_per_speed * v)
        acceleration = (net.sum() - pull) / vehicle.mass
        load = loads(acceleration, pull, (torque - r * net).sum())
        return np.concatenate([[acceleration], (torque - M) / J, z_rate, (load - N) / carried])

    return motion


class SolverError(Exception):
    """A peer returned no result; the text has the reason."""


class Scipy:
    """scipy's `solve_ivp`.

    Parameters
    ----------
    method : str
        Its method.
    form : callable
        Which right-hand side: `closed_form` or `stress_integrals`.
    rtol : float
        Relative tolerance; the absolute one is scipy's own.
    max_step : float
        Longest step, s.
    """

    def __init__(
        self,
        method: str,
        form: Callable[[Problem], Motion],
        rtol: float = 1e-6,
        max_step: float = math.inf,
    ):
        self.name = f'scipy {scipy.__version__} {method}'
        if math.isfinite(max_step):
            self.name += f', step at most {max_step * 1e3:g} ms'
        self._method, self._form, self._rtol, self._max_step = method, form, rtol, max_step

    def __call__(self, problem: Problem, sinkage: Array) -> tuple[float, Array, Array]:
        """Time taken, s; speed, m/s; wheel speeds, rad/s, at the samples of torque."""
        motion = self._form(problem)
        start = np.concatenate([[problem.v0], problem.omega0, sinkage, np.zeros_like(sinkage)])
        samples = SAMPLE_TIME * np.arange(len(problem.torque))
        begin = time.perf_counter()
        done = solve_ivp(
            motion, (0.0, samples[-1]), start, method=self._method, rtol=self._rtol,
            max_step=self._max_step, t_eval=samples,
        )  # fmt: skip
        took = time.perf_counter() - begin
        if not done.success:
            raise SolverError(done.message)
        return took, done.y[0], done.y[1 : 1 + len(problem.omega0)].T


class Octave:
    """Octave's `ode45`, closed form, one wheel.

    Parameters
    ----------
    command : str
        The executable.
    rtol : float
        Relative tolerance; the absolute one is Octave's own.
    """

    def __init__(self, command: str, rtol: float = 1e-6):
        told = subprocess.run([command, '--version'], capture_output=True, text=True, check=True)
        version = re.search(r'version (\S+)', told.stdout)
        self.name = f'Octave {version.group(1) if version else "?"} ode45'
        self._command, self._rtol = command, rtol

    def __call__(self, problem: Problem, sinkage: Array) -> tuple[float, Array, Array]:
        """Time taken without Octave's start, s; speed, m/s; wheel speeds, rad/s."""
        (wheel,) = problem.vehicle.wheels
        soil, drawbar = problem.soil, problem.drawbar
        numbers = {
            'r': wheel.radius,
            'b': wheel.width,
            'J': wheel.inertia,
            'm': problem.vehicle.mass,
            'g': GRAVITY,
            'k': soil.cohesive_modulus / wheel.width + soil.frictional_modulus,
            'n': soil.sinkage_exponent,
            'c': soil.cohesion,
            'tan_phi': math.tan(soil.friction_angle),
            'K': soil.shear_deformation_modulus,
            'D': soil.damping,
            'pull': drawbar.pull,
            'pull_per_speed': drawbar.pull_per_speed,
            'ramp': drawbar.ramp,
            'fade': FADE,
            'dt': SAMPLE_TIME,
            'rtol': self._rtol,
            'start': [problem.v0, float(problem.omega0[0]), float(sinkage[0]), 0.0],
            'torque': problem.torque[:, 0].tolist(),
        }
        with tempfile.TemporaryDirectory() as folder:
            shutil.copy(OCTAVE_SOURCE, folder)
            (Path(folder) / 'problem.json').write_text(json.dumps(numbers))
            done = subprocess.run(
                [self._command, '--no-gui', '--no-init-file', '--quiet', '--eval', 'plate_wheel'],
                cwd=folder,
                capture_output=True,
                text=True,
            )
            if done.returncode:
                raise SolverError(
                    done.stderr.strip().splitlines()[-1] if done.stderr else 'no text'
                )
            rows = np.loadtxt(Path(folder) / 'motion.txt')
        return float(done.stdout.split()[-1]), rows[:, 0], rows[:, 1:2]
