"""The contact form against the steady points of Chrono's wheel rig."""

import lzma
import math
from pathlib import Path

import numpy as np
import pytest

from traction_evaluation.verification.wheel_rig import (
    COLUMNS,
    RIG_FILE,
    read_rig,
    rig_errors,
    rig_table,
    rig_targets,
)
from traction_model.contact.tractive import steady_contact
from traction_model.soil.soil import Soil
from traction_model.vehicle.wheel import Wheel

BAGS = Path(__file__).resolve().parents[4] / 'bags'


def test_rig_within_its_limits():
    points = read_rig(BAGS / RIG_FILE)
    # Every third of 1200 has no slip angle.
    assert len(points['slip']) == 400
    told, untold = (rig_errors(points, told_patch=each) for each in (True, False))
    assert all(target.met for target in rig_targets(told))
    # k_c/b is more than k_c*inv_b: Bekker's wheel sinks less deep where it rests on less than a
    # width; sinkage is off by per cents, force and moment hardly.
    assert np.sqrt(np.mean(untold.sinkage**2)) > 0.01
    assert not rig_targets(untold)[2].met


def test_errors_of_a_point_by_hand(tmp_path):
    """One point that the model meets but for 100 N, 50 N*m and 1 %, and one with a slip angle."""
    soil = Soil(
        cohesive_modulus=0.0, frictional_modulus=1e6 + 3.0 * 5e3, sinkage_exponent=1.0,
        cohesion=1e3, friction_angle=math.radians(30), shear_deformation_modulus=0.02,
        damping=3e4, elastic_modulus=4e7,
    )  # fmt: skip
    wheel = Wheel(radius=0.5, width=0.4, inertia=1.0)
    # 1 m/s at 20 % slip: rim 1.25 m/s.
    sinkage, thrust, resistance, moment = steady_contact(soil, wheel, 0.2, 5000.0, speed=1.25)
    point = {
        'r': 0.5, 'b': 0.4, 'load': 5000.0, 'v': 1.0, 'omega': 2.5, 'slip': 0.2, 'alpha': 0.0,
        'k_phi': 1e6, 'k_c': 5e3, 'n': 1.0, 'c': 1e3, 'phi_deg': 30.0, 'K': 0.02,
        'Fx': thrust - resistance - 100.0, 'My': -(moment + 50.0), 'sinkage': sinkage / 1.01,
        'inv_b': 3.0,
    }  # fmt: skip
    assert tuple(point) == COLUMNS
    lines = [','.join(COLUMNS)]
    for alpha in (0.0, 0.1):
        lines.append(','.join(repr(value) for value in {**point, 'alpha': alpha}.values()))
    path = tmp_path / RIG_FILE
    path.write_bytes(lzma.compress('\n'.join(lines).encode()))
    found = rig_errors(read_rig(path), told_patch=True)
    assert found.slip.tolist() == [0.2]
    assert found.force[0] == pytest.approx(100 / 5000)
    assert found.moment[0] == pytest.approx(50 / (0.5 * 5000))
    assert found.sinkage[0] == pytest.approx(0.01)
    # With k_c/b = 2.5*k_c in place of 3*k_c the soil is softer, the wheel deeper.
    assert rig_errors(read_rig(path), told_patch=False).sinkage[0] > 0.01
    assert '| told the patch | all | 1 | 2.000 | 2.00 | 2.000 | 2.00 | 1.000 | 1.00 |' in (
        rig_table(found, found)
    )


def test_points_that_lack_a_column(tmp_path):
    path = tmp_path / RIG_FILE
    path.write_bytes(lzma.compress(b'r,b\n0.5,0.4\n'))
    with pytest.raises(ValueError, match=rf'{RIG_FILE}: column load is missing'):
        read_rig(path)
