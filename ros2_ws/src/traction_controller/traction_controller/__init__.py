"""Slip estimation and gain-scheduled slip control of wheels on soft soil."""

from traction_controller.control_law import LAWS, Reading, SlipLaw, make_law
from traction_controller.driveline import Differential, Grouping
from traction_controller.exit_reason import ExitReason, LimitStatus
from traction_controller.gain_schedule import ControlWeights, GainSchedule
from traction_controller.gnss import GnssTrack
from traction_controller.immobilisation import Immobilisation
from traction_controller.odometry import PathOdometry
from traction_controller.radius_calibration import RadiusCalibration
from traction_controller.rolling_radius import RollingRadius
from traction_controller.slip_control import (
    Degraded,
    Mode,
    SlipControl,
    TargetSource,
    WheelOutcome,
)
from traction_controller.slip_estimation import EstimatorNoise, SlipEstimation, Source

__all__ = [
    'LAWS',
    'ControlWeights',
    'Degraded',
    'Differential',
    'EstimatorNoise',
    'ExitReason',
    'GainSchedule',
    'GnssTrack',
    'Grouping',
    'Immobilisation',
    'LimitStatus',
    'Mode',
    'PathOdometry',
    'RadiusCalibration',
    'Reading',
    'RollingRadius',
    'SlipControl',
    'SlipEstimation',
    'SlipLaw',
    'Source',
    'TargetSource',
    'WheelOutcome',
    'make_law',
]
