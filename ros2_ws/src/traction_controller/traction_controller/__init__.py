"""Slip estimation and gain-scheduled slip control of wheels on soft soil."""

from traction_controller.control_law import LAWS, Reading, SlipLaw, make_law
from traction_controller.driveline import Differential, Grouping
from traction_controller.exit_reason import ExitReason, LimitStatus
from traction_controller.gain_schedule import ControlWeights, GainSchedule
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
    'Grouping',
    'LimitStatus',
    'Mode',
    'Reading',
    'SlipControl',
    'SlipEstimation',
    'SlipLaw',
    'Source',
    'TargetSource',
    'WheelOutcome',
    'make_law',
]
