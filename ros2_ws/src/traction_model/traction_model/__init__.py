"""Terramechanics of wheels on soft soil: soils, wheels, vehicles, contact forces, motion."""

from traction_model.contact.contact import Form
from traction_model.contact.tractive import (
    TractiveFigures,
    greatest_pull_slip,
    optimum_slip,
    tractive_figures,
)
from traction_model.definition import DefinitionError
from traction_model.lpv.inverse_slip_model import InverseSlipLpvModel
from traction_model.lpv.slip_model import SlipLpvModel
from traction_model.lpv.speed_model import SpeedLpvModel
from traction_model.simulation.batch import Batch, simulate_batch
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.plant import Plant
from traction_model.simulation.simulate import Trajectory, simulate
from traction_model.soil.empirical import Brixius, Burckhardt, CurveFit, Pacejka, fit_curve
from traction_model.soil.soil import Soil, load_soil, preset_soils, read_soils
from traction_model.soil.terrain import Terrain, load_terrain
from traction_model.vehicle.vehicle import Axle, Vehicle, load_vehicle
from traction_model.vehicle.wheel import Wheel

__all__ = [
    'Axle',
    'Batch',
    'Brixius',
    'Burckhardt',
    'CurveFit',
    'DefinitionError',
    'Drawbar',
    'Form',
    'InverseSlipLpvModel',
    'Pacejka',
    'Plant',
    'SlipLpvModel',
    'Soil',
    'SpeedLpvModel',
    'Terrain',
    'TractiveFigures',
    'Trajectory',
    'Vehicle',
    'Wheel',
    'fit_curve',
    'greatest_pull_slip',
    'load_soil',
    'load_terrain',
    'load_vehicle',
    'optimum_slip',
    'preset_soils',
    'read_soils',
    'simulate',
    'simulate_batch',
    'tractive_figures',
]
