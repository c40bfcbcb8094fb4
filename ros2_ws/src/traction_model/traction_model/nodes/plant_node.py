"""Node `plant_node`: simulated vehicle."""

import math
from collections import Counter
from types import SimpleNamespace
from typing import Any

from traction_model.contact.contact import Form
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.plant import Plant
from traction_model.simulation.sensors import Radar, RadarModel, Tachometer
from traction_model.soil.soil import load_soil
from traction_model.soil.terrain import Terrain, load_terrain
from traction_model.vehicle.vehicle import load_vehicle
from traction_node import diagnostic
from traction_node.behaviour import Behaviour
from traction_node.host import RosHost
from traction_node.joints import JointOrder
from traction_node.parameter import NodeParameter
from traction_node.stamp import seconds, to_stamp
from traction_node.subscribers import SubscriberWait
from traction_node.topics import message_class

DELIVERY_TIME = 2.0
"""Longest wait at the end for delivery of the last messages, s."""


class PlantBehaviour(Behaviour):
    """Simulation of a vehicle on soil: torque in, sensor readings and ground truth out."""

    NAME = 'plant_node'
    host: RosHost
    PARAMETERS = (
        NodeParameter(
            'vehicle',
            default='tractor_4wd',
            description='preset or path of a vehicle YAML',
            read_only=True,
        ),
        NodeParameter(
            'soils',
            default=['sandy_loam_chrono'],
            description='presets, or file.yaml:name, in order along the path',
            read_only=True,
        ),
        NodeParameter(
            'soil_starts',
            default=[0.0],
            description=(
                'start of each soil along the path of the rear axle (the first one is not used)'
            ),
            unit='m',
            read_only=True,
        ),
        NodeParameter(
            'terrain',
            default='',
            description=(
                'YAML or CSV file of soils and slopes along the path, in place of soils and grade'
            ),
            read_only=True,
        ),
        NodeParameter(
            'multipass',
            default=True,
            description='true: wheels run in the ruts of others; false: undisturbed soil',
            read_only=True,
        ),
        NodeParameter(
            'form',
            default='contact',
            description='form of the contact model',
            choices=tuple(form.name.lower() for form in Form),
            read_only=True,
        ),
        NodeParameter(
            'sinkage',
            default='dynamic',
            description=(
                'sinkage as a state, or from vertical equilibrium, which is many times '
                'slower and can stall on very soft soil'
            ),
            choices=('dynamic', 'equilibrium'),
            read_only=True,
        ),
        NodeParameter(
            'drawbar_pull',
            default=0.0,
            description='draft of the implement',
            unit='N',
            minimum=0.0,
            read_only=True,
        ),
        NodeParameter(
            'drawbar_pull_per_speed',
            default=0.0,
            description='growth of draft with speed',
            unit='N·s/m',
            minimum=0.0,
            read_only=True,
        ),
        NodeParameter(
            'drawbar_ramp',
            default=2.0,
            description='time of the rise of draft from zero',
            unit='s',
            minimum=0.0,
            read_only=True,
        ),
        NodeParameter(
            'grade',
            default=0.0,
            description='slope, uphill positive',
            unit='rad',
            minimum=-0.785,
            maximum=0.785,
            read_only=True,
        ),
        NodeParameter(
            'torque_time_constant',
            default=0.1,
            description='time constant from commanded to shaft torque',
            unit='s',
            minimum=0.0,
            maximum=2.0,
            read_only=True,
        ),
        NodeParameter(
            'max_power',
            default=0.0,
            description='power of the engine; 0: unlimited',
            unit='W',
            minimum=0.0,
            read_only=True,
        ),
        NodeParameter(
            'torque_timeout',
            default=0.5,
            description='time without wheel_torque after which torque is zero',
            unit='s',
            minimum=0.01,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'rate',
            default=100.0,
            description='rate of wheel_states, in simulated time',
            unit='Hz',
            minimum=10.0,
            maximum=1000.0,
            read_only=True,
        ),
        NodeParameter(
            'real_time_factor',
            default=1.0,
            description=(
                'simulated over real time, at least 0.2; 0: as fast as possible, a step per '
                'wheel_torque. Unless 1, /clock is published and stamps are simulated time; '
                'timeouts and rates of the gate are still in real time'
            ),
            minimum=0.0,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'wait_for_subscribers',
            default=5.0,
            description=(
                'as fast as possible: longest wait, in real time, for a subscriber of every topic '
                'but /clock; 0: no wait'
            ),
            unit='s',
            minimum=0.0,
            maximum=600.0,
            read_only=True,
        ),
        NodeParameter(
            'wait_for_torque',
            default=5.0,
            description=(
                'as fast as possible: longest wait, in real time, for a first publisher of '
                'wheel_torque'
            ),
            unit='s',
            minimum=0.0,
            maximum=60.0,
            read_only=True,
        ),
        NodeParameter(
            'duration',
            default=0.0,
            description='simulated time after which the node ends; 0: never',
            unit='s',
            minimum=0.0,
            read_only=True,
        ),
        NodeParameter(
            'tachometer_pulses',
            default=0.0,
            description='pulses per turn of the tachometers; 0: ideal tachometers',
            minimum=0.0,
            read_only=True,
        ),
        NodeParameter(
            'radar_rate',
            default=20.0,
            description='rate of radar',
            unit='Hz',
            minimum=1.0,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'radar_noise',
            default=0.05,
            description='standard deviation of the radar',
            unit='m/s',
            minimum=0.0,
            read_only=True,
        ),
        NodeParameter(
            'radar_bias',
            default=0.0,
            description='relative error of the scale of the radar',
            minimum=-0.5,
            maximum=0.5,
            read_only=True,
        ),
        NodeParameter(
            'radar_min_speed',
            default=0.2,
            description='smallest speed that the radar measures',
            unit='m/s',
            minimum=0.0,
            read_only=True,
        ),
        NodeParameter(
            'radar_latency',
            default=0.0,
            description='delay of the radar',
            unit='s',
            minimum=0.0,
            maximum=1.0,
            read_only=True,
        ),
        NodeParameter(
            'seed',
            default=0,
            description='seed of the noise',
            minimum=0,
            read_only=True,
        ),
    )

    def check_parameters(self, p: SimpleNamespace) -> None:
        """Check that definitions can be loaded and lists have matching lengths."""
        if 0.0 < p.real_time_factor < 0.2:
            raise ValueError(
                f'real_time_factor {p.real_time_factor} is too slow: the torque gate takes '
                'commands this far apart for a failure; give 0 or at least 0.2'
            )
        self._build(p)

    def _build(self, p: SimpleNamespace) -> Plant:
        vehicle = load_vehicle(p.vehicle)
        if p.terrain:
            terrain = load_terrain(p.terrain)
        else:
            soils = [load_soil(name) for name in p.soils]
            if len(p.soil_starts) != len(soils):
                raise ValueError(
                    f'{len(soils)} soils need as many soil_starts, got {len(p.soil_starts)}'
                )
            terrain = Terrain(soils, p.soil_starts[1:], p.grade)
        return Plant(
            vehicle,
            terrain,
            form=Form[p.form.upper()],
            sinkage=p.sinkage,
            drawbar=Drawbar(p.drawbar_pull, p.drawbar_pull_per_speed, p.drawbar_ramp),
            multipass=p.multipass,
            torque_time_constant=p.torque_time_constant,
            max_power=p.max_power or math.inf,
        )

    def configure(self) -> None:
        """Construct the plant and start the simulation."""
        p = self.host.p
        self._plant = self._build(p)
        names = self._plant.vehicle.wheel_names
        self._torques = JointOrder(names, 'wheel_torque effort')
        self._tachometer = Tachometer(len(names), p.tachometer_pulses)
        self._radar = Radar(
            RadarModel(p.radar_noise, p.radar_bias, p.radar_min_speed, p.radar_latency), p.seed
        )
        self._dt = 1.0 / p.rate
        self._steps = 0
        self._came_due: Counter[str] = Counter()
        self._torque = [0.0] * len(names)
        self._torque_steady = -math.inf
        self._answered = True  # no wheel_states published yet
        self._refused = ''
        self._over = False

        self._outputs = {}
        self._messages = {}
        for name in ('wheel_states', 'radar', 'ground_truth/slip_estimate',
                     'ground_truth/terrain_estimate', 'ground_truth/odometry'):  # fmt: skip
            self._outputs[name] = self.host.publisher(name)
            self._messages[name] = self.host.message(name)
        self._messages['wheel_states'].name = list(names)
        self._messages['wheel_states'].header.frame_id = 'base_link'
        radar = self._messages['radar']
        radar.header.frame_id = 'radar'
        radar.twist.covariance[0] = max(p.radar_noise, 1e-3) ** 2
        truth = self._messages['ground_truth/slip_estimate']
        truth.header.frame_id = 'base_link'
        truth.wheel_names = list(names)
        truth.slip_variance = [0.0] * len(names)
        truth.ground_based_speed_valid = True
        truth.source = truth.SOURCE_SIMULATED
        truth.slip_stiffness = [math.nan] * len(names)
        truth.rolling_radius = [wheel.radius for wheel in self._plant.vehicle.wheels]
        truth.rolling_radius_variance = [0.0] * len(names)
        truth.time_to_immobilisation = math.nan
        terrain = self._messages['ground_truth/terrain_estimate']
        terrain.header.frame_id = 'base_link'
        terrain.wheel_names = list(names)
        terrain.max_shear_stress_variance = [0.0] * len(names)
        terrain.shear_deformation_modulus_variance = [0.0] * len(names)
        terrain.slip_stiffness = [math.nan] * len(names)
        terrain.sinkage_variance = [0.0] * len(names)
        odometry = self._messages['ground_truth/odometry']
        odometry.header.frame_id = 'odom'
        odometry.child_frame_id = 'base_link'

        self._publishers = list(self._outputs.values())
        self._simulated_clock = p.real_time_factor != 1.0
        if self._simulated_clock:
            clock = message_class('rosgraph_msgs/msg/Clock')
            self._clock_message = clock()
            self._clock_publisher = self.host.node.create_publisher(clock, '/clock', 1)
            self._publishers.append(self._clock_publisher)
            self._epoch = 0.0
        else:
            self._epoch = self.host.now() * 1e-9
        self.host.subscription('wheel_torque', self._on_torque)
        self._wait = None
        if p.real_time_factor == 0.0:
            self._wait = SubscriberWait(self._outputs, p.wait_for_subscribers)
            self.host.set_diagnostic(diagnostic.WARN, 'waiting for subscribers')
        else:
            self._begin()
        period = self._dt / p.real_time_factor if p.real_time_factor else 1e-3
        self.host.steady_timer(period, self._tick)

    def _begin(self):
        """Publish the state at time 0 and start the simulation."""
        p = self.host.p
        self._began = self.host.steady_time()
        self._publish()
        self.host.set_diagnostic(diagnostic.OK, 'simulating', vehicle=p.vehicle, soil=p.soils[0])

    def _on_torque(self, message: Any) -> None:
        try:
            self._torque = self._torques.values(message.name, message.effort)
        except ValueError as error:
            self._refused = str(error)
            self.host.set_diagnostic(diagnostic.WARN, self._refused)
            return
        if self._refused:
            self._refused = ''
            self.host.set_diagnostic(diagnostic.OK, 'simulating')
        self._torque_steady = self.host.steady_time()
        if self.host.p.real_time_factor == 0.0 and not self._answered:
            self._answered = seconds(message.header.stamp) >= self._stamp - 1e-6
            if self._answered:
                self._step()

    def _tick(self) -> None:
        if self.host.p.real_time_factor:
            due = (self.host.steady_time() - self._began) * self.host.p.real_time_factor
            # A late tick catches up; a very late one only in part.
            for _ in range(10):
                if self._plant.t + self._dt > due:
                    break
                self._step()
            return
        if self._wait is not None:
            if self._wait.over(self.host.steady_time()):
                if self._wait.missing:
                    self.host.get_logger().info(
                        f'simulating without subscriber to {", ".join(self._wait.missing)}'
                    )
                self._wait = None
                self._begin()
            return
        waited = self.host.steady_time() - self._stepped
        if self.host.publisher_count('wheel_torque'):
            # wheel_torque triggers the step; without it the torque is zero.
            if waited > self.host.p.torque_timeout:
                self._step()
        elif self._steps or waited > self.host.p.wait_for_torque:
            # No publisher to wait for; return to the executor regularly.
            until = self.host.steady_time() + 0.005
            while self.host.steady_time() < until:
                self._step()

    def _step(self) -> None:
        if self._over:
            return
        silent = self.host.steady_time() - self._torque_steady > self.host.p.torque_timeout
        torque = [0.0] * len(self._torque) if silent else self._torque
        self._plant.step(torque, self._dt)
        self._steps += 1
        self._publish()
        if self.host.p.duration and self._plant.t >= self.host.p.duration - 1e-9:
            self._over = True
            self.host.await_delivery(self._publishers, DELIVERY_TIME)
            self.host.finish()

    def _send(self, name: str, message: Any) -> None:
        to_stamp(message.header.stamp, self._stamp)
        self._outputs[name].publish(message)

    def _publish(self) -> None:
        plant, p = self._plant, self.host.p
        self._stamp = self._epoch + plant.t
        if self._simulated_clock:
            to_stamp(self._clock_message.clock, self._stamp)
            self._clock_publisher.publish(self._clock_message)

        slip = self._messages['ground_truth/slip_estimate']
        slip.slip = plant.slip
        slip.valid = plant.slip_valid
        slip.wheel_based_speed = plant.rim_speed.tolist()
        slip.ground_based_speed = plant.v
        slip.gross_traction = plant.gross_traction.tolist()
        self._send('ground_truth/slip_estimate', slip)
        if self._due('ground_truth/terrain_estimate', 10.0):
            terrain = self._messages['ground_truth/terrain_estimate']
            terrain.max_shear_stress = plant.max_shear_stress
            terrain.shear_deformation_modulus = plant.shear_deformation_modulus
            terrain.gross_traction = plant.gross_traction.tolist()
            terrain.sinkage = plant.sinkage.tolist()
            terrain.valid = plant.slip_valid
            terrain.external_resistance = plant.external_resistance
            self._send('ground_truth/terrain_estimate', terrain)
        if self._due('ground_truth/odometry', 50.0):
            odometry = self._messages['ground_truth/odometry']
            odometry.pose.pose.position.x = plant.x
            odometry.twist.twist.linear.x = plant.v
            self._send('ground_truth/odometry', odometry)
        if self._due('radar', p.radar_rate):
            self._radar.measure(plant.t, plant.v)
        for t, speed in self._radar.deliver(plant.t):
            radar = self._messages['radar']
            radar.twist.twist.linear.x = speed
            to_stamp(radar.header.stamp, self._epoch + t)
            self._outputs['radar'].publish(radar)
        # Last, because other nodes respond to it.
        wheels = self._messages['wheel_states']
        wheels.velocity = self._tachometer.read(plant.omega, self._dt).tolist()
        wheels.effort = plant.shaft_torque.tolist()
        self._answered = False
        self._stepped = self.host.steady_time()
        self._send('wheel_states', wheels)

    def _due(self, name: str, rate: float) -> bool:
        """True if a topic with its own rate is due at this step, at most once per step.

        The k-th due time is k/rate of simulated time, so the mean rate is exact even if the period
        is no multiple of the step.
        """
        due: bool = self._steps * rate >= (self._came_due[name] - 1e-6) * self.host.p.rate
        self._came_due[name] += due
        return due


def main() -> int:
    """Run the node."""
    from traction_node.run import run

    return run(PlantBehaviour)
