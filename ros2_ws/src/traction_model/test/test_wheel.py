"""Wheels: what grousers add."""

import pytest

from traction_model.soil import COHESION, TAN_PHI, load_soil
from traction_model.wheel import Wheel


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
