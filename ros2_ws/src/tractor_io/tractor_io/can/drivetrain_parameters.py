"""Parameters of wheels and drivetrain, shared by the nodes `can_bridge` and `tractor_ecu`."""

from types import SimpleNamespace

from traction_node.parameter import NodeParameter
from tractor_io.can.drivetrain import Drivetrain

DRIVETRAIN_PARAMETERS = (
    NodeParameter(
        'wheel_names',
        default=['fl', 'fr', 'rl', 'rr'],
        description='names of the wheels: front left, front right, rear left, rear right',
        read_only=True,
    ),
    NodeParameter(
        'wheel_radii',
        default=[0.65, 0.65, 0.85, 0.85],
        description='rolling radius of each wheel',
        unit='m',
        minimum=0.01,
        maximum=5.0,
        read_only=True,
    ),
    NodeParameter(
        'reference_torque',
        default=500.0,
        description='engine torque of 100 %',
        unit='N·m',
        minimum=1.0,
        maximum=1e5,
        read_only=True,
    ),
    NodeParameter(
        'gear_ratio',
        default=40.0,
        description='engine speed over wheel speed',
        minimum=1e-3,
        maximum=1e4,
        read_only=True,
    ),
    NodeParameter(
        'efficiency',
        default=0.9,
        description='wheel torque over the product of ratio and engine torque',
        minimum=0.01,
        maximum=1.0,
        read_only=True,
    ),
    NodeParameter(
        'front_share',
        default=0.3,
        description='share of the front axle in the torque while it is engaged',
        minimum=0.0,
        maximum=0.99,
        read_only=True,
    ),
    NodeParameter(
        'front_engaged',
        default=True,
        description='true if the front axle is driven',
    ),
)
"""Parameters of wheels and drivetrain."""


def make_drivetrain(p: SimpleNamespace) -> Drivetrain:
    """Drivetrain from the parameters of a node.

    Parameters
    ----------
    p : types.SimpleNamespace
        Values of `DRIVETRAIN_PARAMETERS`, SI units.

    Returns
    -------
    Drivetrain
        Of four wheels, front and rear.

    Raises
    ------
    ValueError
        If parameters contradict each other.
    """
    if len(p.wheel_names) != len(p.wheel_radii) or len(set(p.wheel_names)) != len(p.wheel_names):
        raise ValueError('parameter "wheel_radii" must give one radius for each of "wheel_names"')
    if len(p.wheel_names) != 4:
        raise ValueError('parameter "wheel_names" must name four wheels, the number in HRW')
    front = (True, True, False, False)
    return Drivetrain(front, p.reference_torque, p.gear_ratio, p.efficiency, p.front_share)
