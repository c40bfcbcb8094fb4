"""Slip estimation and gain-scheduled slip control of wheels on soft soil."""

from traction_controller.control.driveline import Differential, Grouping
from traction_controller.control.exit_reason import ExitReason, LimitStatus
from traction_controller.control.laws.law import SlipLaw, WheelState
from traction_controller.control.laws.registry import LAWS, make_law
from traction_controller.control.slip_control import Mode, SlipControl, TargetSource
from traction_controller.control.slip_controller import SlipController
from traction_controller.control.slip_state import SlipState
from traction_controller.control.wheel_outcome import Degraded, WheelOutcome
from traction_controller.estimation.gnss import GnssTrack
from traction_controller.estimation.immobilisation import Immobilisation
from traction_controller.estimation.odometry import PathOdometry
from traction_controller.estimation.radius_calibration import RadiusCalibration
from traction_controller.estimation.rolling_radius import RollingRadius
from traction_controller.estimation.slip_filter import EstimatorNoise, SlipFilter, Source
from traction_controller.estimation.vehicle_estimator import VehicleEstimator
from traction_controller.synthesis.gain_schedule import ControlWeights, GainSchedule

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
    'RollingRadius',
    'SlipControl',
    'SlipController',
    'SlipFilter',
    'SlipLaw',
    'SlipState',
    'Source',
    'TargetSource',
    'VehicleEstimator',
    'WheelOutcome',
    'WheelState',
    'make_law',
]
