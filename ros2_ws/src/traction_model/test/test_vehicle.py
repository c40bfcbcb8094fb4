"""Vehicles: loads by hand calculation, and faults of their definitions."""

import pytest

from traction_model.definition import DefinitionError
from traction_model.vehicle.vehicle import Axle, Vehicle, load_vehicle
from traction_model.vehicle.wheel import Wheel

VEHICLE = """
chassis_mass: 1000
chassis_cg_x: 1.0
chassis_cg_height: 0.8
axles:
  - wheel_names: [front]
    x: 2.0
    wheel: {radius: 0.5, width: 0.3, inertia: 5}
  - wheel_names: [rear]
    x: 0
    wheel: {radius: 0.5, width: 0.3, inertia: 5}
"""


def test_tractor_at_rest():
    tractor = load_vehicle('tractor_4wd')
    # 3600 kg of chassis, 2*120 kg of front and 2*300 kg of rear wheels.
    assert tractor.mass == 4440.0
    # x: (3600*0.9 + 240*2.4)/4440; height: (3600*1.0 + 240*0.65 + 600*0.85)/4440.
    assert tractor.centre_of_gravity == pytest.approx((3816 / 4440, 4266 / 4440))
    # Moment about the rear axle: one front wheel carries 3816 kg*m*9.81/(2*2.4 m) = 7798.95 N,
    # one rear wheel half of 4440*9.81 N less that: 13979.25 N.
    assert tractor.static_loads() == pytest.approx([7798.95, 7798.95, 13979.25, 13979.25])
    assert tractor.wheel_names == ('fl', 'fr', 'rl', 'rr')
    assert [wheel.inertia for wheel in tractor.wheels] == [15, 15, 60, 60]


def test_rig_carries_all_on_its_wheel():
    assert load_vehicle('single_wheel_rig').static_loads() == pytest.approx([500 * 9.81])


def test_three_axles():
    wheel = Wheel(radius=0.5, width=0.3, inertia=5)
    vehicle = Vehicle(
        chassis_mass=1000,
        chassis_cg_x=2.5,
        chassis_cg_height=0.8,
        axles=[
            Axle(wheel_names=[f'{x}'], x=x, wheel=wheel) for x in (4.0, 2.0, 0.0)
        ],
    )  # fmt: skip
    # Equal springs under a rigid chassis: load linear in x, q0 + q1*(x - 2). Sum: 3*q0 = W.
    # Moment about x = 2: q1*(4 + 0 + 4) = 0.5*W. So W*(1/3 + 1/8), W/3, W*(1/3 - 1/8).
    weight = 9810.0
    assert vehicle.static_loads() == pytest.approx([weight * 11 / 24, weight / 3, weight * 5 / 24])


@pytest.mark.parametrize(
    ('old', 'new', 'reason'),
    [
        ('width: 0.3, inertia: 5}\n  -', 'widht: 0.3, inertia: 5}\n  -',
         "axles.0.wheel.widht: unknown key; did you mean 'width'?"),
        ('chassis_cg_x:', 'chassis_cgx:', "chassis_cgx: unknown key; did you mean 'chassis_cg_x'"),
        ('chassis_mass: 1000\n', '', 'chassis_mass: missing'),
        ('mass: 1000', 'mass: 0', 'chassis_mass: Input should be greater than 0, got 0'),
        ('mass: 1000', 'mass: .inf', 'chassis_mass: Input should be a finite number, got inf'),
        ('mass: 1000', 'mass: much', "chassis_mass: Input should be a valid number"),
        ('[rear]', '[front]', ": wheel name 'front' is given twice"),
        ('[rear]', '[]', 'axles.1.wheel_names: List should have at least 1 item'),
        ('[rear]', 'rear', "axles.1.wheel_names: Input should be a list, got 'rear'"),
        ('x: 0\n', 'x: 2.0\n', ': two axles have the same x'),
        ('chassis_cg_x: 1.0', 'chassis_cg_x: 2.5', 'the centre of gravity lifts a wheel at rest'),
        ('chassis_cg_x: 1.0', 'chassis_cg_x: 1.0e+308', 'masses and positions are too large'),
    ],
)  # fmt: skip
def test_fault_is_named_with_file_and_key(tmp_path, old, new, reason):
    assert old in VEHICLE
    path = tmp_path / 'mine.yaml'
    path.write_text(VEHICLE)
    assert load_vehicle(path).mass == 1000
    path.write_text(VEHICLE.replace(old, new, 1))
    with pytest.raises(DefinitionError) as refused:
        load_vehicle(path)
    assert str(refused.value).startswith(str(path))
    assert reason in str(refused.value)


def test_fault_is_told_without_the_whole_file(tmp_path):
    path = tmp_path / 'mine.yml'
    path.write_text(VEHICLE.replace('[rear]', '[front]'))
    with pytest.raises(DefinitionError) as refused:
        load_vehicle(path)
    assert str(refused.value) == f"{path}: wheel name 'front' is given twice"
    path.write_text(VEHICLE.replace('chassis_mass: 1000', f'chassis_mass: {list(range(50))}'))
    with pytest.raises(DefinitionError) as refused:
        load_vehicle(path)
    # 60 characters of what was given.
    shown = str(list(range(50)))[:60]
    assert str(refused.value).endswith(
        f'chassis_mass: Input should be a valid number, got {shown}…'
    )


def test_file_may_end_in_yml(tmp_path):
    path = tmp_path / 'mine.yml'
    path.write_text(VEHICLE)
    assert load_vehicle(path).mass == 1000


def test_unknown_vehicle_names_the_nearest(tmp_path):
    with pytest.raises(
        DefinitionError, match=r"unknown vehicle 'tractor_4dw'; did you mean 'tractor_4wd'\?"
    ):
        load_vehicle('tractor_4dw')
    with pytest.raises(DefinitionError, match=r'absent\.yaml: No such file'):
        load_vehicle(tmp_path / 'absent.yaml')
