"""Node `slip_estimator`: slip, speed, soil and pose from the sensors.

The node converts messages; `traction_controller.estimation.vehicle_estimator` computes the
estimates.
"""

import contextlib
import copy
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from traction_controller.estimation.immobilisation import WarningLimits
from traction_controller.estimation.odometry import UNOBSERVED
from traction_controller.estimation.rolling_radius import FirmGround
from traction_controller.estimation.slip_filter import EstimatorNoise
from traction_controller.estimation.vehicle_estimator import VehicleEstimator
from traction_node.behaviour import Behaviour
from traction_node.joints import JointError, JointOrder
from traction_node.parameter import NodeParameter
from traction_node.stamp import between

_NOISE = EstimatorNoise()
_LIMITS = WarningLimits()
_GROUND = FirmGround()
# Indices of x, y and yaw in a covariance of shape (6, 6).
_PLANAR = np.ix_([0, 1, 5], [0, 1, 5])


class SlipEstimatorBehaviour(Behaviour):
    """Slip estimate, published for every reading of the wheels."""

    NAME = 'slip_estimator'
    LIFECYCLE = True
    PARAMETERS = (
        NodeParameter(
            'vehicle',
            default='tractor_4wd',
            description='preset or path of a vehicle YAML',
            read_only=True,
        ),
        NodeParameter(
            'soil',
            default='sandy_loam_chrono',
            description='nominal soil: preset or file.yaml:name',
            read_only=True,
        ),
        NodeParameter(
            'min_speed',
            default=0.3,
            description='speed of rim or vehicle below which slip is not valid',
            unit='m/s',
            minimum=0.05,
            maximum=2.0,
            read_only=True,
        ),
        NodeParameter(
            'radar_timeout',
            default=0.5,
            description='time without measured speed after which slip comes from torque alone',
            unit='s',
            minimum=0.05,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'radar_variance',
            default=0.0025,
            description='variance of a measured speed without one',
            unit='m²/s²',
            minimum=1e-6,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'stuck_time',
            default=0.15,
            description=(
                'time for which a reading of a tachometer or radar may stay the same while others '
                'change by 2 %, longer in proportion for smaller changes; 0: no check'
            ),
            unit='s',
            minimum=0.0,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'terrain_rate',
            default=10.0,
            description='rate of terrain_estimate',
            unit='Hz',
            minimum=1.0,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'odometry_rate',
            default=50.0,
            description='rate of odometry',
            unit='Hz',
            minimum=1.0,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'method',
            default='ukf',
            description=(
                'Kalman filter: ukf (best), ekf (half the time) or scheduled_gain (precomputed)'
            ),
            read_only=True,
        ),
        NodeParameter(
            'tachometer_pulses',
            default=0.0,
            description='pulses per turn of the tachometers; 0: found from the readings',
            minimum=0.0,
            maximum=1e6,
            read_only=True,
        ),
        NodeParameter(
            'radar_latency',
            default=0.0,
            description='delay of the stamps of radar after the measurement',
            unit='s',
            minimum=0.0,
            maximum=0.5,
            read_only=True,
        ),
        NodeParameter(
            'radar_min_speed',
            default=0.0,
            description='smallest speed that the radar measures',
            unit='m/s',
            minimum=0.0,
            maximum=2.0,
            read_only=True,
        ),
        NodeParameter(
            'gnss_latency',
            default=0.0,
            description='delay of the stamps of gnss and gnss_velocity after the measurement',
            unit='s',
            minimum=0.0,
            maximum=0.5,
            read_only=True,
        ),
        NodeParameter(
            'calibrate_radius',
            default=False,
            description='calibrate the rolling radii at low gross traction',
            read_only=True,
        ),
        NodeParameter(
            'calibration_effort',
            default=_GROUND.largest_effort,
            description='largest gross traction over load of a wheel for calibration',
            minimum=1e-3,
            maximum=1.0,
            read_only=True,
        ),
        NodeParameter(
            'track_width',
            default=0.0,
            description=(
                'distance between the outer wheels of the rear axle, which must not '
                'steer; 0: no estimation of yaw'
            ),
            unit='m',
            minimum=0.0,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'warning_horizon',
            default=_LIMITS.horizon,
            description='time to standstill at which the warning of immobilisation is given',
            unit='s',
            minimum=0.1,
            maximum=60.0,
            read_only=True,
        ),
        NodeParameter(
            'warning_slip',
            default=_LIMITS.slip,
            description='share of power lost in slip at which the warning is given',
            minimum=0.05,
            maximum=1.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_acceleration',
            default=_NOISE.acceleration,
            description='random walk of the drawbar, as acceleration',
            unit='m/s²/√s',
            minimum=1e-4,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_speed',
            default=_NOISE.speed,
            description='random walk of the speed beyond the model',
            unit='m/s/√s',
            minimum=1e-4,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_soil',
            default=_NOISE.soil,
            description="random walk of the logarithms of the soil's parameters",
            unit='1/√s',
            minimum=1e-4,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_strength',
            default=_NOISE.strength,
            description='standard deviation of ln(tau_max) after a change of soil',
            minimum=1e-3,
            maximum=3.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_shear_modulus',
            default=_NOISE.shear_modulus,
            description='standard deviation of ln(K) after a change of soil',
            minimum=1e-3,
            maximum=3.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_sinkage_modulus',
            default=_NOISE.sinkage_modulus,
            description='standard deviation of ln(sinkage modulus) after a change of soil',
            minimum=1e-3,
            maximum=3.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_nominal',
            default=_NOISE.nominal,
            description='initial standard deviation for the nominal soil, as share of these three',
            minimum=1e-3,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_gross_traction',
            default=_NOISE.gross_traction,
            description='standard deviation of gross traction from its curve, over static load',
            minimum=1e-4,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_slip',
            default=_NOISE.slip,
            description='standard deviation of the slip at which a gross traction is reached',
            minimum=1e-4,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_wheel_speed',
            default=_NOISE.wheel_speed,
            description='standard deviation of a reading of an ideal tachometer',
            unit='rad/s',
            minimum=1e-5,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_wheel_acceleration',
            default=_NOISE.wheel_acceleration,
            description='random walk of the wheel speed between pulses, as a share of it',
            unit='1/√s',
            minimum=1e-3,
            maximum=100.0,
            read_only=True,
        ),
    )

    def check_parameters(self, p: SimpleNamespace) -> None:
        """Check that the definitions can be loaded."""
        VehicleEstimator.check_parameters(p)

    def configure(self) -> None:
        """Construct the estimator and the messages."""
        self._estimator = VehicleEstimator.from_parameters(self.host.p)
        # Stamp of the first reading of the wheels, the origin of time.
        self._epoch: Any = None
        names = list(self._estimator.vehicle.wheel_names)
        self._speeds = JointOrder(names, 'wheel_states velocity')
        self._torques = JointOrder(names, 'wheel_states effort')
        self._publish_slip = self.host.publisher('slip_estimate').publish
        self._slip = self.host.message('slip_estimate')
        self._slip.wheel_names = names
        self._slip.header.frame_id = 'base_link'
        self._publish_terrain = self.host.publisher('terrain_estimate').publish
        self._terrain = self.host.message('terrain_estimate')
        self._terrain.wheel_names = names
        self._terrain.header.frame_id = 'base_link'
        self._publish_odometry = self.host.publisher('odometry').publish
        self._odometry_message = self.host.message('odometry')
        self._odometry_message.header.frame_id = 'odom'
        self._odometry_message.child_frame_id = 'base_link'
        self._pose_covariance = UNOBSERVED * np.eye(6)
        self.host.subscription('wheel_states', self._on_wheel_states)
        self.host.subscription('radar', self._on_radar)
        self.host.subscription('gnss_velocity', self._on_gnss_velocity)
        self.host.subscription('gnss', self._on_gnss)
        self.host.subscription('imu', self._on_imu)
        self._commands = JointOrder(names, 'wheel_torque effort')
        self.host.subscription('wheel_torque', self._on_wheel_torque)

    def activate(self) -> None:
        """Reset the estimate, as the vehicle may have moved."""
        self._estimator.reset()
        self._epoch = None
        level, said = self._estimator.health
        self.host.set_diagnostic(int(level), said)

    def _on_wheel_states(self, message: Any) -> None:
        if not self.host.active:
            return
        estimator = self._estimator
        stamp = message.header.stamp
        try:
            omega = self._speeds.values(message.name, message.velocity)
            torque = self._torques.values(message.name, message.effort)
        except JointError as error:
            estimator.refuse('wheel_states', str(error))
            self._report_health()
            return
        if self._epoch is None:
            # Copied, since the message may be reused.
            self._epoch = copy.copy(stamp)
        believed = estimator.wheel_states(between(self._epoch, stamp), omega, torque)
        if estimator.time_jump:
            self.host.get_logger().warning(estimator.health[1])
        if believed:
            self._send_slip(stamp)
        if estimator.terrain_due:
            self._check_publishers()
            self._send_terrain(stamp)
        if estimator.health_due:
            self._report_health()
        if estimator.odometry_due:
            self._send_odometry(stamp)

    def _check_publishers(self) -> None:
        count = self.host.publisher_count('wheel_states')
        self._estimator.note_publishers('wheel_states', count)

    def _on_radar(self, message: Any) -> None:
        self._on_speed(self._estimator.radar, message)

    def _on_gnss_velocity(self, message: Any) -> None:
        self._on_speed(self._estimator.gnss_velocity, message)

    def _on_speed(self, update: Callable[[float, float, float], bool], message: Any) -> None:
        if not self.host.active or self._epoch is None:
            return
        t = between(self._epoch, message.header.stamp)
        update(t, message.twist.twist.linear.x, message.twist.covariance[0])
        if self._estimator.health_due:
            self._report_health()

    def _on_gnss(self, message: Any) -> None:
        if not self.host.active or self._epoch is None:
            return
        position = message.pose.pose.position
        t = between(self._epoch, message.header.stamp)
        self._estimator.gnss(t, [position.x, position.y, position.z])
        if self._estimator.health_due:
            self._report_health()

    def _on_imu(self, message: Any) -> None:
        if not self.host.active or self._epoch is None:
            return
        rate = message.angular_velocity
        self._estimator.imu(
            between(self._epoch, message.header.stamp),
            message.linear_acceleration.x,
            message.linear_acceleration_covariance[0],
            rate.z,
            rate.y,
        )
        if self._estimator.health_due:
            self._report_health()

    def _on_wheel_torque(self, message: Any) -> None:
        if not self.host.active:
            return
        # Torques of other wheels, as of another vehicle, have no information.
        with contextlib.suppress(JointError):
            self._estimator.commanded_torque(self._commands.values(message.name, message.effort))

    def _send_slip(self, stamp: Any) -> None:
        message, estimator = self._slip, self._estimator
        message.header.stamp = stamp
        message.slip = estimator.slip.tolist()
        message.slip_variance = estimator.slip_variance.tolist()
        message.valid = estimator.valid.tolist()
        message.wheel_based_speed = estimator.rim_speed.tolist()
        message.ground_based_speed = estimator.v
        message.ground_based_speed_variance = estimator.v_variance
        message.ground_based_speed_valid = estimator.v_valid
        message.source = int(estimator.source)
        message.gross_traction = estimator.gross_traction.tolist()
        message.slip_stiffness = estimator.slip_stiffness.tolist()
        message.rolling_radius = estimator.slip_filter.rolling_radius.tolist()
        message.rolling_radius_variance = estimator.calibration.radius_variance.tolist()
        message.immobilisation = int(estimator.immobilisation.level)
        message.immobilisation_reason = estimator.immobilisation.reason.value
        message.time_to_immobilisation = estimator.immobilisation.time_left
        self._publish_slip(message)

    def _send_terrain(self, stamp: Any) -> None:
        message, soil = self._terrain, self._estimator.slip_filter
        message.header.stamp = stamp
        message.max_shear_stress = soil.max_shear_stress.tolist()
        message.max_shear_stress_variance = soil.max_shear_stress_variance.tolist()
        message.shear_deformation_modulus = soil.shear_deformation_modulus.tolist()
        message.shear_deformation_modulus_variance = (
            soil.shear_deformation_modulus_variance.tolist()
        )
        message.gross_traction = soil.gross_traction.tolist()
        message.slip_stiffness = soil.slip_stiffness.tolist()
        message.sinkage = soil.sinkage.tolist()
        message.sinkage_variance = soil.sinkage_variance.tolist()
        message.valid = soil.strength_known.tolist()
        message.external_resistance = soil.external_resistance
        message.external_resistance_variance = soil.external_resistance_variance
        self._publish_terrain(message)

    def _send_odometry(self, stamp: Any) -> None:
        message, odometry = self._odometry_message, self._estimator.odometry
        message.header.stamp = stamp
        pose, twist = message.pose, message.twist
        pose.pose.position.x = odometry.x
        pose.pose.position.y = odometry.y
        pose.pose.orientation.z = math.sin(0.5 * odometry.yaw)
        pose.pose.orientation.w = math.cos(0.5 * odometry.yaw)
        self._pose_covariance[_PLANAR] = odometry.covariance
        pose.covariance = self._pose_covariance.ravel()
        twist.twist.linear.x = self._estimator.v
        twist.twist.angular.z = self._estimator.yaw_rate
        twist.covariance[0] = self._estimator.v_variance
        twist.covariance[35] = min(self._estimator.yaw_rate_variance, UNOBSERVED)
        self._publish_odometry(message)

    def _report_health(self) -> None:
        estimator = self._estimator
        level, said = estimator.health
        self.host.set_diagnostic(
            int(level),
            said,
            ground_speed=estimator.v,
            ground_speed_deviation=math.sqrt(estimator.v_variance),
            gnss_refused=estimator.gnss_track.refused,
            radius_state=estimator.radius_state,
            tachometer_pulses=round(estimator.tachometers.pulses_per_turn),
            time_to_immobilisation=estimator.immobilisation.time_left,
        )


def main():
    """Run the node."""
    from traction_node.run import run

    return run(SlipEstimatorBehaviour)
