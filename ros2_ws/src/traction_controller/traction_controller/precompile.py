"""Compilation of the kernels at set-up, so that nodes start fast."""

from traction_controller.estimation.kalman import Method
from traction_controller.estimation.slip_filter import SlipFilter
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle


def main() -> None:
    """Run every kernel of the package."""
    for method in Method:
        estimation = SlipFilter(
            load_vehicle('single_wheel_rig'), load_soil('paper_sand'), method=method.name.lower()
        )
        for k in range(3):
            estimation.wheel_states(0.01 * k, [2.0], [500.0])
            estimation.radar(0.01 * k, 0.9, 0.0025)


if __name__ == '__main__':
    main()
