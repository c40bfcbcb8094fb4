"""Slip estimation and gain-scheduled slip control of wheels on soft soil."""

from traction_controller.gain_schedule import ControlWeights, GainSchedule
from traction_controller.slip_control import Mode, SlipControl, WheelOutcome
from traction_controller.slip_estimation import EstimatorNoise, SlipEstimation, Source

__all__ = [
    'ControlWeights',
    'EstimatorNoise',
    'GainSchedule',
    'Mode',
    'SlipControl',
    'SlipEstimation',
    'Source',
    'WheelOutcome',
]
