"""Driveline: which wheels go together."""

import pytest

from traction_controller.control.driveline import Grouping, driven_axles, wheel_groups
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')  # fl, fr, rl, rr
RIG = load_vehicle('single_wheel_rig')


@pytest.mark.parametrize(
    ('grouping', 'driven', 'groups'),
    [
        (Grouping.WHEEL, 'all', [(0,), (1,), (2,), (3,)]),
        (Grouping.AXLE, 'all', [(0, 1), (2, 3)]),
        (Grouping.VEHICLE, 'all', [(0, 1, 2, 3)]),
        (Grouping.WHEEL, 'rear', [(2,), (3,)]),
        (Grouping.AXLE, 'front', [(0, 1)]),
        (Grouping.VEHICLE, 'rear', [(2, 3)]),
    ],
)
def test_groups_of_a_tractor(grouping, driven, groups):
    assert wheel_groups(TRACTOR, grouping, driven_axles(TRACTOR, driven)) == groups


def test_three_axles():
    front, rear = TRACTOR.axles
    middle = rear.model_copy(update={'wheel_names': ('ml', 'mr'), 'x': 1.2})
    truck = TRACTOR.model_copy(update={'axles': (front, middle, rear)})
    assert driven_axles(truck, 'rear') == (1, 2)
    assert wheel_groups(truck, Grouping.AXLE, (1, 2)) == [(2, 3), (4, 5)]


@pytest.mark.parametrize(
    ('vehicle', 'which', 'reason'),
    [
        (TRACTOR, 'back', "driven axles must be all, front, rear, got 'back'"),
        (RIG, 'rear', 'a vehicle with one axle has no rear axle to drive: drive all'),
    ],
)
def test_refused(vehicle, which, reason):
    with pytest.raises(ValueError, match=reason):
        driven_axles(vehicle, which)
