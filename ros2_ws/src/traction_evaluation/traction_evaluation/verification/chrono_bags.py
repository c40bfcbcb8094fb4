"""Bags in bags/ from the Project Chrono runs beside them (compressed CSV).

The same CSV gives the same bytes, with the noise of the radar. bags/README.md describes the
content.
"""

import lzma
import math
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from traction_evaluation.verification.chrono import CHRONO_RUNS, ChronoRecording, read_chrono
from traction_evaluation.verification.wheel_rig import RIG_FILE
from traction_model.slip import MIN_SPEED, is_valid
from traction_model.vehicle.vehicle import GRAVITY
from traction_node.quality_of_service import QOS
from traction_node.topics import topic
from tractor_io.bags.message_types import typestore
from tractor_io.bags.writer import BagWriter

EPOCH = 1_000_000_000
"""Stamp of the first sample of every bag, ns."""

RADAR_SIGMA = 0.05
"""Standard deviation of the radar's noise, m/s."""

IMU_NOISE, IMU_BIAS = 0.2, 0.15
"""Standard deviation and bias of the acceleration of the inertial measurement unit, m/s²."""

YAW_NOISE, YAW_BIAS = 0.005, 0.004
"""Standard deviation and bias of its yaw and pitch rate, rad/s."""

SOURCE = 'Project Chrono 8.0.0, SCM deformable terrain, simulated by this project'

TOPICS = (
    'wheel_states',
    'radar',
    'wheel_torque',
    'ground_truth/slip_estimate',
    'ground_truth/terrain_estimate',
    'ground_truth/odometry',
)
"""Topics of every bag; those of turns also have `imu`."""

SEEDS = {
    'tractor_sandy_loam': 1,
    'tractor_soft_patch': 2,
    'wheel_drawbar': 3,
    'wheel_high_slip': 4,
    'wheel_low_slip': 5,
    'wheel_soft_patch': 6,
    'wheel_torque_sine': 7,
    'tractor_braked': 8,
    'tractor_steps_slow': 9,
    'turn_left': 10,
    'turn_slalom': 11,
    'turn_pull': 12,
    'tractor_steps_medium': 13,
}
"""Seed of the radar's noise for each run; fixed."""


class Samples:
    """Columns of a run, one entry per 5 ms, with the columns of all wheels combined.

    Parameters
    ----------
    recording : ChronoRecording
        The run.
    """

    def __init__(self, recording: ChronoRecording):
        self.names = list(recording.vehicle.wheel_names)
        self.radius = np.array([wheel.radius for wheel in recording.vehicle.wheels])
        self.time = recording.t
        self.v = recording.v
        self.x = recording.x
        self.wheel_v = recording.wheel_v
        self.slip = recording.slip
        standing = np.zeros_like(self.time)
        self.y, self.yaw, self.pitch, self.roll, self.v_y, self.yaw_rate = (
            recording.columns.get(name, standing)
            for name in ('y', 'yaw', 'pitch', 'roll', 'v_y', 'yaw_rate')
        )
        self.torque = recording.torque
        self.omega = recording.omega
        self.sinkage = recording.sinkage
        self.force = recording.net_force
        self.rim_speed = recording.rim_speed
        self.inertia = np.array([wheel.inertia for wheel in recording.vehicle.wheels])
        self.friction = np.array([wheel.viscous_friction for wheel in recording.vehicle.wheels])
        measured = recording.columns.get('drawbar')
        drawbar = recording.run.drawbar
        if measured is None:
            pull = drawbar.pull + drawbar.pull_per_speed * self.v
            measured = pull * np.minimum(1.0, self.time / drawbar.ramp)
        # Force along the vehicle at the centre of gravity, l ahead of the rear axle, in a turn:
        # m*(v' - yaw'*(v_y + l*yaw')) = F.
        ahead, _ = recording.vehicle.centre_of_gravity
        turning = self.yaw_rate * (self.v_y + ahead * self.yaw_rate)
        self.accelerating = self.force.sum(axis=1) - measured + recording.vehicle.mass * turning

    def gross_traction(self, since: slice) -> NDArray[np.float64]:
        """Mean moment of the soil over the radius: (T - b_f*omega - J*omega')/r.

        Parameters
        ----------
        since : slice
            Samples for the mean.

        Returns
        -------
        ndarray, shape (n,)
            N, forward positive.
        """
        omega, t = self.omega[since], self.time[since]
        spin_up = (omega[-1] - omega[0]) / (t[-1] - t[0]) if len(t) > 1 else 0.0
        moment = self.torque[since].mean(axis=0) - self.friction * omega.mean(axis=0)
        return np.asarray((moment - self.inertia * spin_up) / self.radius)


class Messages:
    """Messages of a bag from samples, one method per type.

    Parameters
    ----------
    samples : Samples
        The run.
    seed : int
        Seed of the noise of the radar.
    """

    def __init__(self, samples: Samples, seed: int):
        self._s = samples
        self._types = typestore().types
        noise = np.random.default_rng(seed).normal(0.0, RADAR_SIGMA, len(samples.time))
        self._radar_speed = samples.v + noise
        # Of its own, so that the radar's noise does not depend on it.
        self._imu_random = np.random.default_rng([seed, 1])

    def stamp(self, k: int) -> int:
        """Stamp of sample k, ns."""
        return EPOCH + round(float(self._s.time[k]) * 1e9)

    def wheel_states(self, k: int) -> Any:
        """Tachometers and shaft torques."""
        return self._joint_state(k, self._s.omega[k], self._s.torque[k])

    def wheel_torque(self, k: int) -> Any:
        """Commanded torques; the runs apply them as commanded."""
        return self._joint_state(k, np.zeros(0), self._s.torque[k])

    def radar(self, k: int) -> Any:
        """True speed with noise; only linear.x is measured."""
        types = self._types
        covariance = np.zeros(36)
        covariance[0] = RADAR_SIGMA**2
        twist = types['geometry_msgs/msg/TwistWithCovariance'](
            twist=self._twist(self._radar_speed[k]), covariance=covariance
        )
        return types['geometry_msgs/msg/TwistWithCovarianceStamped'](
            header=self._header(k, 'radar'), twist=twist
        )

    def imu(self, k: int) -> Any:
        """Specific force along the vehicle and rates with noise and bias, means since the last."""
        s, types = self._s, self._types
        before = max(0, k - FAST_STEP)
        dt = max(float(s.time[k] - s.time[before]), 1e-9)
        # Along the vehicle: v' - yaw'*v_y, and gravity with the nose up.
        force = (s.v[k] - s.v[before]) / dt - s.yaw_rate[k] * s.v_y[k]
        force += GRAVITY * math.sin(s.pitch[k]) + IMU_BIAS
        # Nose down is positive (REP-103).
        pitch_rate = -(s.pitch[k] - s.pitch[before]) / dt + YAW_BIAS
        force, yaw_rate, pitch_rate = (
            self._imu_random.normal(mean, deviation)
            for mean, deviation in (
                (force, IMU_NOISE),
                (s.yaw_rate[k] + YAW_BIAS, YAW_NOISE),
                (pitch_rate, YAW_NOISE),
            )
        )
        vector = types['geometry_msgs/msg/Vector3']
        covariance = np.zeros(9)
        covariance[0] = IMU_NOISE**2
        return types['sensor_msgs/msg/Imu'](
            header=self._header(k, 'base_link'),
            orientation=types['geometry_msgs/msg/Quaternion'](x=0.0, y=0.0, z=0.0, w=1.0),
            # No orientation is measured.
            orientation_covariance=np.array([-1.0, *np.zeros(8)]),
            angular_velocity=vector(x=0.0, y=pitch_rate, z=yaw_rate),
            angular_velocity_covariance=np.diag([0.0, YAW_NOISE**2, YAW_NOISE**2]).ravel(),
            linear_acceleration=vector(x=force, y=0.0, z=GRAVITY),
            linear_acceleration_covariance=covariance,
        )

    def slip_estimate(self, k: int) -> Any:
        """True slip and speeds; forces and slip stiffness are unknown at one instant: NaN.

        Slip of each wheel is in its own plane, with the speed of its own centre.
        """
        s = self._s
        rims = s.rim_speed[k]
        n = len(s.names)
        kind: Any = self._types['traction_interfaces/msg/SlipEstimate']
        return kind(
            header=self._header(k, 'base_link'),
            wheel_names=s.names,
            slip=s.slip[k],
            slip_variance=np.zeros(n),
            valid=np.array(
                [is_valid(v, rim, MIN_SPEED) for v, rim in zip(s.wheel_v[k], rims, strict=True)]
            ),
            wheel_based_speed=rims,
            ground_based_speed=s.v[k],
            ground_based_speed_variance=0.0,
            ground_based_speed_valid=True,
            source=kind.SOURCE_SIMULATED,
            gross_traction=np.full(n, np.nan),
            slip_stiffness=np.full(n, np.nan),
            rolling_radius=s.radius,
            rolling_radius_variance=np.zeros(n),
            immobilisation=kind.IMMOBILISATION_NONE,
            immobilisation_reason='',
            time_to_immobilisation=float('nan'),
        )

    def terrain_estimate(self, k: int) -> Any:
        """True gross traction, external resistance and sinkage; forces are means since the last.

        Gross traction is shaft torque less bearing friction and acceleration of the wheel, over
        the radius. Gross traction less external resistance accelerates the vehicle. Shear stress
        and slip stiffness are unknown: NaN. All other values are exact: valid.
        """
        s = self._s
        n = len(s.names)
        unknown = np.full(n, np.nan)
        since = slice(max(0, k - TERRAIN_STEP + 1), k + 1)
        gross_traction = s.gross_traction(since)
        return self._types['traction_interfaces/msg/TerrainEstimate'](
            header=self._header(k, 'base_link'),
            wheel_names=s.names,
            max_shear_stress=unknown,
            max_shear_stress_variance=unknown,
            shear_deformation_modulus=unknown,
            shear_deformation_modulus_variance=unknown,
            gross_traction=gross_traction,
            slip_stiffness=unknown,
            sinkage=s.sinkage[k],
            sinkage_variance=np.zeros(n),
            valid=np.ones(n, dtype=bool),
            external_resistance=float(gross_traction.sum() - s.accelerating[since].mean()),
            external_resistance_variance=0.0,
        )

    def odometry(self, k: int) -> Any:
        """True position, attitude and speed."""
        types, s = self._types, self._s
        # Nose up is a negative turn about y, which points left (REP-103).
        attitude = Rotation.from_euler('ZYX', [s.yaw[k], -s.pitch[k], s.roll[k]])
        x, y, z, w = map(float, attitude.as_quat(canonical=True))
        pose = types['geometry_msgs/msg/Pose'](
            position=types['geometry_msgs/msg/Point'](x=s.x[k], y=s.y[k], z=0.0),
            orientation=types['geometry_msgs/msg/Quaternion'](x=x, y=y, z=z, w=w),
        )
        return types['nav_msgs/msg/Odometry'](
            header=self._header(k, 'odom'),
            child_frame_id='base_link',
            pose=types['geometry_msgs/msg/PoseWithCovariance'](pose=pose, covariance=np.zeros(36)),
            twist=types['geometry_msgs/msg/TwistWithCovariance'](
                twist=self._twist(s.v[k], s.v_y[k], s.yaw_rate[k]), covariance=np.zeros(36)
            ),
        )

    def _header(self, k: int, frame: str) -> Any:
        sec, nanosec = divmod(self.stamp(k), 10**9)
        stamp = self._types['builtin_interfaces/msg/Time'](sec=sec, nanosec=nanosec)
        return self._types['std_msgs/msg/Header'](stamp=stamp, frame_id=frame)

    def _joint_state(
        self, k: int, velocity: NDArray[np.float64], effort: NDArray[np.float64]
    ) -> Any:
        return self._types['sensor_msgs/msg/JointState'](
            header=self._header(k, 'base_link'),
            name=self._s.names,
            position=np.zeros(0),
            velocity=velocity,
            effort=effort,
        )

    def _twist(self, speed: float, sideways: float = 0.0, turning: float = 0.0) -> Any:
        vector = self._types['geometry_msgs/msg/Vector3']
        return self._types['geometry_msgs/msg/Twist'](
            linear=vector(x=speed, y=sideways, z=0.0), angular=vector(x=0.0, y=0.0, z=turning)
        )


# Samples between messages: 100, 50 and 10 Hz.
FAST_STEP, ODOMETRY_STEP, TERRAIN_STEP = 2, 4, 20


def make_bag(name: str, csv_path: Path, folder: Path) -> None:
    """Write the bag of a run.

    Parameters
    ----------
    name : str
        A key of CHRONO_RUNS.
    csv_path : Path
        CSV file of the samples.
    folder : Path
        Folder of the bag; must not exist.
    """
    run = CHRONO_RUNS[name]
    samples = Samples(read_chrono(csv_path, run))
    messages = Messages(samples, SEEDS[name])
    about = {'vehicle': run.vehicle, 'soil': run.soils[0], 'source': f'{SOURCE}: run {name}'}
    with BagWriter(folder, about) as bag:
        for name in (*TOPICS, 'imu') if run.steered else TOPICS:
            row = topic(name)
            bag.add_topic(f'/{name}', row.type, QOS[row.qos])
        for k in range(0, len(samples.time), FAST_STEP):
            time = messages.stamp(k)
            # Before the wheels, which the estimator compares with it.
            if run.steered:
                bag.write('/imu', time, messages.imu(k))
            bag.write('/wheel_states', time, messages.wheel_states(k))
            if k % TERRAIN_STEP == 0:
                bag.write('/radar', time, messages.radar(k))
            bag.write('/wheel_torque', time, messages.wheel_torque(k))
            bag.write('/ground_truth/slip_estimate', time, messages.slip_estimate(k))
            if k % TERRAIN_STEP == 0:
                bag.write('/ground_truth/terrain_estimate', time, messages.terrain_estimate(k))
            if k % ODOMETRY_STEP == 0:
                bag.write('/ground_truth/odometry', time, messages.odometry(k))


def remake(name: str, bags: Path) -> None:
    """Write the bag of a run again, beside its CSV.

    Parameters
    ----------
    name : str
        A key of CHRONO_RUNS.
    bags : Path
        Folder of all bags.
    """
    folder = bags / name
    with tempfile.TemporaryDirectory(dir=bags) as scratch:
        made = Path(scratch) / name
        make_bag(name, folder / f'{name}.csv.xz', made)
        for path in made.iterdir():
            path.replace(folder / path.name)


def import_csv(source: Path, bags: Path) -> None:
    """Compress the CSV of every run into the folder of its bag, and that of the wheel rig.

    Parameters
    ----------
    source : Path
        Folder of the uncompressed CSV files.
    bags : Path
        Folder of all bags.
    """
    packed = {f'{name}.csv': bags / name / f'{name}.csv.xz' for name in CHRONO_RUNS}
    packed['wheel_rig.csv'] = bags / RIG_FILE
    for name, target in packed.items():
        target.parent.mkdir(parents=True, exist_ok=True)
        with (
            (source / name).open('rb') as plain,
            lzma.open(target, 'wb', preset=9 | lzma.PRESET_EXTREME) as compressed,
        ):
            shutil.copyfileobj(plain, compressed)


def make_bags(
    names: Sequence[str], bags: Path, csv: Path | None = None
) -> Iterator[tuple[Path, int]]:
    """Write bags again.

    Parameters
    ----------
    names : sequence of str
        Names of runs, keys of `CHRONO_RUNS`; empty: all.
    bags : Path
        Folder of all bags.
    csv : Path, optional
        Folder of uncompressed CSV files, to compress first.

    Yields
    ------
    path : Path
        Each bag.
    size : int
        Size of its MCAP file, bytes.

    Raises
    ------
    ValueError
        If there is no such run, or a CSV file is wrong.
    OSError
        If a file cannot be read or written.
    """
    for name in names:
        if name not in CHRONO_RUNS:
            raise ValueError(f"no run '{name}'; there are: {', '.join(CHRONO_RUNS)}")
    if csv is not None:
        import_csv(csv, bags)
    for name in names or CHRONO_RUNS:
        remake(name, bags)
        yield bags / name, (bags / name / f'{name}.mcap').stat().st_size
