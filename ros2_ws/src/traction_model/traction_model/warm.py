"""Compile the kernels once, so that a node does not have to when it starts."""

from traction_model.contact import Form
from traction_model.simulate import Plant, simulate
from traction_model.soil import load_soil
from traction_model.terrain import Terrain
from traction_model.vehicle import load_vehicle


def main() -> None:
    """Run every kernel of the package."""
    vehicle = load_vehicle('single_wheel_rig')
    terrain = Terrain(load_soil('paper_sand'))
    for form in Form:
        Plant(vehicle, terrain, form=form).step([100.0], 0.01)
    simulate(vehicle, terrain, [[0.0], [100.0], [100.0]], 0.01)


if __name__ == '__main__':
    main()
