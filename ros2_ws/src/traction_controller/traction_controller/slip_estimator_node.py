"""The node `slip_estimator`: slip, ground speed and soil strength from the vehicle's sensors."""

import math
from dataclasses import fields

from traction_controller.kalman import method_named
from traction_controller.odometry import PathOdometry
from traction_controller.slip_estimation import EstimatorNoise, SlipEstimation, Source
from traction_interfaces.msg import SlipEstimate, TerrainEstimate
from traction_model.soil import load_soil
from traction_model.vehicle import load_vehicle
from traction_node import diagnostic
from traction_node.joints import JointOrder
from traction_node.node import TractionLifecycleNode
from traction_node.parameter import Parameter
from traction_node.run import run
from traction_node.stamp import between

_NOISE = EstimatorNoise()


class SlipEstimatorNode(TractionLifecycleNode):
    """Publishes a slip estimate for every reading of the wheels."""

    NAME = 'slip_estimator'
    PARAMETERS = (
        Parameter('vehicle', 'tractor_4wd', 'preset or path of a vehicle YAML', read_only=True),
        Parameter(
            'soil', 'sandy_loam_chrono', 'nominal soil: preset or file.yaml:name', read_only=True
        ),
        Parameter(
            'least_speed', 0.3, 'speed of rim or vehicle below which slip is not valid', 'm/s',
            0.05, 2.0, read_only=True,
        ),
        Parameter(
            'radar_timeout', 0.5, 'silence after which slip rests on torque alone', 's', 0.05,
            10.0, read_only=True,
        ),
        Parameter(
            'radar_variance', 0.0025, 'variance of a radar reading that does not state one',
            'm²/s²', 1e-6, 10.0, read_only=True,
        ),
        Parameter(
            'terrain_rate', 10.0, 'rate of terrain_estimate', 'Hz', 1.0, 100.0, read_only=True
        ),
        Parameter('odometry_rate', 50.0, 'rate of odometry', 'Hz', 1.0, 100.0, read_only=True),
        Parameter(
            'method', 'ukf', 'Kalman filter: ukf (best), ekf (half the time) or lpv (gains '
            'computed beforehand)', read_only=True,
        ),
        Parameter(
            'tachometer_pulses', 0.0, 'pulses per turn that the tachometers count; 0: ideal', '',
            0.0, 1e6, read_only=True,
        ),
        Parameter(
            'radar_latency', 0.0, 'time by which the stamps of radar are late', 's', 0.0, 0.5,
            read_only=True,
        ),
        Parameter(
            'radar_least_speed', 0.0, 'speed below which the radar is blind', 'm/s', 0.0, 2.0,
            read_only=True,
        ),
        Parameter(
            'gnss_latency', 0.0, 'time by which the stamps of gnss_velocity are late', 's', 0.0,
            0.5, read_only=True,
        ),
        Parameter(
            'noise_acceleration', _NOISE.acceleration, 'random walk of the drawbar, as '
            'acceleration', 'm/s²/√s', 1e-4, 100.0, read_only=True,
        ),
        Parameter(
            'noise_speed', _NOISE.speed, 'random walk of the speed beyond the model', 'm/s/√s',
            1e-4, 10.0, read_only=True,
        ),
        Parameter(
            'noise_soil', _NOISE.soil, "random walk of the logarithms of the soil's parameters",
            '1/√s', 1e-4, 10.0, read_only=True,
        ),
        Parameter(
            'noise_strength', _NOISE.strength, 'deviation of ln(tau_max) where soil changes', '',
            1e-3, 3.0, read_only=True,
        ),
        Parameter(
            'noise_shear_modulus', _NOISE.shear_modulus, 'deviation of ln(K) where soil changes',
            '', 1e-3, 3.0, read_only=True,
        ),
        Parameter(
            'noise_sinkage_modulus', _NOISE.sinkage_modulus, 'deviation of the logarithm of the '
            'sinkage modulus where soil changes', '', 1e-3, 3.0, read_only=True,
        ),
        Parameter(
            'noise_nominal', _NOISE.nominal, 'share of these that the nominal soil is off', '',
            1e-3, 10.0, read_only=True,
        ),
        Parameter(
            'noise_thrust', _NOISE.thrust, 'deviation of thrust from its curve, as share of the '
            'static load', '', 1e-4, 10.0, read_only=True,
        ),
        Parameter(
            'noise_slip', _NOISE.slip, 'deviation of the slip at which a thrust is reached', '',
            1e-4, 10.0, read_only=True,
        ),
        Parameter(
            'noise_wheel_speed', _NOISE.wheel_speed, 'deviation of an ideal tachometer', 'rad/s',
            1e-5, 10.0, read_only=True,
        ),
        Parameter(
            'noise_wheel_acceleration', _NOISE.wheel_acceleration, 'random walk of the wheel '
            'speed between pulses', 'rad/s/√s', 1e-3, 100.0, read_only=True,
        ),
    )  # fmt: skip

    def check_parameters(self, p):
        """Refuse definitions that cannot be loaded."""
        load_vehicle(p.vehicle)
        load_soil(p.soil)
        method_named(p.method)

    def configure(self):
        """Build the estimator and its messages."""
        p = self.p
        vehicle = load_vehicle(p.vehicle)
        noise = {f.name: getattr(p, f'noise_{f.name}') for f in fields(EstimatorNoise)}
        self._estimation = SlipEstimation(
            vehicle,
            load_soil(p.soil),
            EstimatorNoise(**noise),
            p.least_speed,
            p.radar_timeout,
            p.radar_variance,
            method=p.method,
            tachometer_pulses=p.tachometer_pulses,
            radar_latency=p.radar_latency,
            gnss_latency=p.gnss_latency,
            radar_least_speed=p.radar_least_speed,
        )
        names = list(vehicle.wheel_names)
        self._speeds = JointOrder(names, 'wheel_states velocity')
        self._torques = JointOrder(names, 'wheel_states effort')
        self._slip = SlipEstimate(wheel_names=names)
        self._slip.header.frame_id = 'base_link'
        self._terrain = TerrainEstimate(wheel_names=names)
        self._terrain.header.frame_id = 'base_link'

        self._publish_slip = self.publisher('slip_estimate').publish
        self._publish_terrain = self.publisher('terrain_estimate').publish
        self._odometry_publisher = self.publisher('odometry')
        self._odometry_message = self._odometry_publisher.msg_type()
        self._odometry_message.header.frame_id = 'odom'
        self._odometry_message.child_frame_id = 'base_link'
        self._odometry = PathOdometry()
        self._start_over()
        self.subscription('wheel_states', self._on_wheel_states)
        self.subscription('radar', self._on_radar)
        self.subscription('gnss_velocity', self._on_gnss)

    def _start_over(self):
        """Estimate anew; the distance travelled so far stays."""
        self._estimation.reset()
        self._odometry_t = None
        self._epoch = None
        self._terrain_due = 0.0
        self._odometry_due = 0.0
        self._refused = {}
        self._disbelieved = 0

    def activate(self):
        """Begin with nothing known: the vehicle may have moved meanwhile."""
        self._start_over()
        self.set_diagnostic(diagnostic.WARN, 'waiting for wheel_states')

    def _time(self, stamp):
        """Seconds since the first reading; a clock that was set back starts everything over."""
        if self._epoch is not None:
            t = between(self._epoch, stamp)
            if t > self._estimation.t - SlipEstimation.LONGEST_GAP:
                return t
            self.get_logger().warning(
                f'time jumped back by {self._estimation.t - t:.3f} s: estimating anew'
            )
            self._start_over()
        # A copy: the message may be reused.
        self._epoch = type(stamp)(sec=stamp.sec, nanosec=stamp.nanosec)
        return 0.0

    def _on_wheel_states(self, message):
        if not self.active:
            return
        estimation = self._estimation
        try:
            omega = self._speeds.values(message.name, message.velocity)
            torque = self._torques.values(message.name, message.effort)
            t = self._time(message.header.stamp)
            estimation.wheel_states(t, omega, torque)
        except ValueError as error:
            self._refuse('wheel_states', error)
            return
        self._refused.pop('wheel_states', None)
        if self._odometry_t is not None and t - self._odometry_t <= estimation.LONGEST_GAP:
            dt = t - self._odometry_t
            self._odometry.advance(dt, estimation.v, estimation.v_variance)
        self._odometry_t = t

        slip = self._slip
        slip.header.stamp = message.header.stamp
        slip.slip = estimation.slip.tolist()
        slip.slip_variance = estimation.slip_variance.tolist()
        slip.valid = estimation.valid.tolist()
        slip.wheel_based_speed = estimation.rim_speed.tolist()
        slip.ground_based_speed = estimation.v
        slip.ground_based_speed_variance = estimation.v_variance
        slip.ground_based_speed_valid = estimation.v_valid
        slip.source = int(estimation.source)
        self._publish_slip(slip)
        if t >= self._terrain_due:
            self._terrain_due = t + 1.0 / self.p.terrain_rate - 1e-6
            self._send_terrain(message.header.stamp)
            self._report_health()
        if t >= self._odometry_due:
            self._odometry_due = t + 1.0 / self.p.odometry_rate - 1e-6
            self._send_odometry(message.header.stamp)

    def _on_radar(self, message):
        self._on_speed('radar', self._estimation.radar, message)

    def _on_gnss(self, message):
        self._on_speed('gnss_velocity', self._estimation.gnss, message)

    def _on_speed(self, topic, take_in, message):
        # Before the first wheel_states there is nothing that the speed could belong to.
        if not self.active or self._epoch is None:
            return
        twist = message.twist
        t = between(self._epoch, message.header.stamp)
        try:
            believed = take_in(t, twist.twist.linear.x, twist.covariance[0])
        except ValueError as error:
            self._refuse(topic, error)
            return
        blind = topic == 'radar' and abs(twist.twist.linear.x) < self.p.radar_least_speed
        self._disbelieved = 0 if believed or blind else self._disbelieved + 1
        self._refused.pop(topic, None)

    def _send_terrain(self, stamp):
        terrain, estimation = self._terrain, self._estimation
        terrain.header.stamp = stamp
        terrain.max_shear_stress = estimation.max_shear_stress.tolist()
        terrain.max_shear_stress_variance = estimation.max_shear_stress_variance.tolist()
        terrain.shear_deformation_modulus = estimation.shear_deformation_modulus.tolist()
        terrain.shear_deformation_modulus_variance = (
            estimation.shear_deformation_modulus_variance.tolist()
        )
        terrain.thrust = estimation.thrust.tolist()
        terrain.slip_stiffness = estimation.slip_stiffness.tolist()
        terrain.sinkage = estimation.sinkage.tolist()
        terrain.sinkage_variance = estimation.sinkage_variance.tolist()
        terrain.valid = estimation.strength_known.tolist()
        terrain.motion_resistance = estimation.resistance
        terrain.motion_resistance_variance = estimation.resistance_variance
        self._publish_terrain(terrain)

    def _send_odometry(self, stamp):
        odometry = self._odometry_message
        odometry.header.stamp = stamp
        odometry.pose.pose.position.x = self._odometry.x
        odometry.pose.covariance[0] = self._odometry.variance
        odometry.twist.twist.linear.x = self._estimation.v
        odometry.twist.covariance[0] = self._estimation.v_variance
        self._odometry_publisher.publish(odometry)

    def _refuse(self, what, error):
        self._refused[what] = str(error)
        self._report_health()

    def _report_health(self):
        estimation = self._estimation
        if self._refused:
            level, said = diagnostic.ERROR, 'refused: ' + '; '.join(self._refused.values())
        elif self._disbelieved:
            level, said = diagnostic.WARN, 'radar contradicts wheels and torque: not believed'
        elif estimation.source is Source.WHEEL:
            level, said = diagnostic.WARN, 'radar silent: slip rests on shaft torque'
        else:
            level, said = diagnostic.OK, 'estimating'
        self.set_diagnostic(
            level,
            said,
            ground_speed=estimation.v,
            ground_speed_deviation=math.sqrt(estimation.v_variance),
        )


def main():
    """Run the node."""
    return run(SlipEstimatorNode)
