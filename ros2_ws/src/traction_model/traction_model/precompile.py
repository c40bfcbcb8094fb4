"""Compilation of the kernels at set-up, so that nodes start fast."""

from traction_model.contact.contact import Form
from traction_model.contact.tractive import tractive_figures
from traction_model.interpolation import GridTable
from traction_model.simulation.batch import simulate_batch
from traction_model.simulation.plant import Plant
from traction_model.simulation.simulate import simulate
from traction_model.soil.empirical import Brixius
from traction_model.soil.soil import load_soil
from traction_model.soil.terrain import Terrain
from traction_model.vehicle.vehicle import load_vehicle


def main() -> None:
    """Run every kernel of the package."""
    vehicle = load_vehicle('single_wheel_rig')
    curve = Brixius(mobility_number=30)
    terrain = Terrain(load_soil('paper_sand').model_copy(update={'traction_curve': curve}))
    for form in Form:
        plant = Plant(vehicle, terrain, form=form)
        plant.step([100.0], 0.01)
    # Functions of the plant used by the node.
    _ = plant.slip, plant.slip_valid, plant.max_shear_stress, plant.external_resistance
    tractive_figures(load_soil('paper_sand'), vehicle, [0.1])
    curve.net_traction_ratio([0.1])
    GridTable([[0.0, 1.0]], [0.0, 1.0]).at(0.5)
    simulate(vehicle, terrain, [[0.0], [100.0], [100.0]], 0.01)
    simulate_batch(vehicle, terrain, [[0.0], [100.0], [100.0]], 0.01)


if __name__ == '__main__':
    main()
