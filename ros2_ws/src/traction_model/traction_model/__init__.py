"""Terramechanics of wheels on soft soil: soils, wheels, vehicles, contact forces, motion."""

from traction_model.contact import Form
from traction_model.definition import DefinitionError
from traction_model.simulate import Drawbar, Plant, Trajectory, simulate
from traction_model.soil import Soil, load_soil, preset_soils, read_soils
from traction_model.terrain import Terrain, load_terrain
from traction_model.vehicle import Axle, Vehicle, load_vehicle
from traction_model.wheel import Wheel

__all__ = [
    'Axle',
    'DefinitionError',
    'Drawbar',
    'Form',
    'Plant',
    'Soil',
    'Terrain',
    'Trajectory',
    'Vehicle',
    'Wheel',
    'load_soil',
    'load_terrain',
    'load_vehicle',
    'preset_soils',
    'read_soils',
    'simulate',
]
