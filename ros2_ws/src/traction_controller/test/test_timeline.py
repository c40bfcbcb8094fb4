"""Timeline of stamps: gaps, clocks that were set, and second clocks."""

import pytest

from traction_controller.estimation.timeline import Timeline


@pytest.fixture
def timeline():
    """Readings every 10 ms from 0 to 1 s."""
    timeline = Timeline(0.5)
    for k in range(101):
        assert timeline.add(0.01 * k) == 0.0
    return timeline


def rejected(timeline, t):
    try:
        timeline.add(t)
    except ValueError:
        return True
    return False


@pytest.mark.parametrize('off', [-1000.0, -0.7, 0.6, 1000.0])
def test_a_clock_that_was_set_is_believed_after_a_tenth_of_a_second(timeline, off):
    begin = 1.0 + off
    assert [rejected(timeline, begin + 0.01 * k) for k in range(10)] == [True] * 10
    # 0.11 s after the first, clear of rounding.
    assert timeline.add(begin + 0.11) == pytest.approx(off + 0.11)
    assert timeline.newest == begin + 0.11
    assert timeline.add(begin + 0.12) == 0.0


@pytest.mark.parametrize('off', [-1000.0, -0.7, 1000.0])
def test_a_second_clock_is_never_believed(timeline, off):
    for k in range(1000):
        t = 1.01 + 0.01 * k
        assert timeline.add(t) == 0.0
        # Twice as often as the first.
        assert rejected(timeline, t + off)
        assert rejected(timeline, t + off + 0.005)


def test_one_reading_a_second_is_never_believed():
    timeline = Timeline(0.5)
    timeline.add(0.0)
    assert all(rejected(timeline, float(k)) for k in range(1, 100))


def test_late_readings_are_on_the_timeline(timeline):
    assert timeline.add(0.6) == 0.0
    assert timeline.newest == 1.0


def test_the_reason_has_the_distance(timeline):
    with pytest.raises(ValueError, match=r'stamp is -30.0 s off the last one'):
        timeline.add(-29.0)
