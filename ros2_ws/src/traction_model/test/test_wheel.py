"""Wheels: what grousers add, and how long contact is."""

import math

import pytest

from traction_model.soil.soil import COHESION, TAN_PHI, load_soil
from traction_model.vehicle.wheel import Wheel


def test_grousers_by_hand():
    # h 5 mm, b 50 mm: cohesion times 1 + 2*0.1 = 1.2; tan(phi) times
    # 1 + 0.64*0.1*atan(10) = 1 + 0.064*1.471128 = 1.094152.
    smooth = Wheel(radius=0.058, width=0.05, inertia=1e-3)
    lugged = Wheel(radius=0.058, width=0.05, inertia=1e-3, grouser_height=0.005)
    assert smooth.grip == (1.0, 1.0)
    assert lugged.grip == pytest.approx((1.2, 1.094152), abs=1e-6)
    soil = load_soil('pavlov_sand')
    under_smooth, under_lugged = soil.packed(smooth), soil.packed(lugged)
    assert under_lugged[COHESION] == pytest.approx(1.2 * under_smooth[COHESION])
    assert under_lugged[TAN_PHI] == pytest.approx(1.094152 * under_smooth[TAN_PHI], rel=1e-6)


def test_packed_wheel():
    wheel = Wheel(radius=0.5, width=0.4, inertia=20, viscous_friction=2)
    assert wheel.packed(1.5, 5000, 1).tolist() == [0.5, 0.4, 20, 2, 1.5, 5000, 1]


def test_contact_length_by_hand():
    # Half the radius deep: an arc of 60 degrees, r*pi/3.
    wheel = Wheel(radius=0.6, width=0.4, inertia=20)
    assert wheel.contact_length(0.3) == pytest.approx(0.6 * math.pi / 3)
    assert wheel.contact_length(0.0) == 0.0
    for sinkage in (-0.01, 0.61, math.nan):
        with pytest.raises(ValueError, match=r'sinkage must be 0 to 0\.6 m, got'):
            wheel.contact_length(sinkage)
