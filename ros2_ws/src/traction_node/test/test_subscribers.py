"""The wait for subscribers, on a clock and with publishers made up here."""

from types import SimpleNamespace

from traction_node.subscribers import SETTLE_TIME, SubscriberWait


def publisher(count=0):
    """Make a publisher whose number of subscribers is set by the test."""
    made = SimpleNamespace(count=count)
    made.get_subscription_count = lambda: made.count
    return made


def test_it_waits_for_every_topic_and_until_the_match_is_known_to_both():
    radar, wheels = publisher(), publisher()
    wait = SubscriberWait({'radar': radar, 'wheel_states': wheels}, 5.0)
    assert not wait.over(100.0)
    assert wait.missing == ['radar', 'wheel_states']
    radar.count = 2
    assert not wait.over(101.0)
    assert wait.missing == ['wheel_states']
    wheels.count = 1
    assert not wait.over(102.0)
    assert wait.missing == []
    assert not wait.over(102.0 + 0.9 * SETTLE_TIME)
    assert wait.over(102.0 + SETTLE_TIME)


def test_a_subscriber_that_goes_is_waited_for_anew():
    radar = publisher(1)
    wait = SubscriberWait({'radar': radar}, 5.0)
    assert not wait.over(0.0)
    radar.count = 0
    assert not wait.over(SETTLE_TIME)
    radar.count = 1
    assert not wait.over(2 * SETTLE_TIME)
    assert wait.over(3 * SETTLE_TIME)


def test_it_ends_with_its_time_out_and_names_who_is_missing():
    wait = SubscriberWait({'radar': publisher(), 'wheel_states': publisher(1)}, 5.0)
    assert not wait.over(10.0)
    assert not wait.over(14.9)
    assert wait.over(15.0)
    assert wait.missing == ['radar']


def test_a_match_just_before_the_time_out_still_settles():
    radar = publisher()
    wait = SubscriberWait({'radar': radar}, 5.0)
    assert not wait.over(0.0)
    radar.count = 1
    assert not wait.over(5.0)
    assert wait.over(5.0 + SETTLE_TIME)


def test_no_time_for_subscribers_begins_at_once_without_them():
    assert SubscriberWait({'radar': publisher()}, 0.0).over(3.0)


def test_it_counts_subscribers_where_more_than_one_is_needed():
    request = publisher(1)
    wait = SubscriberWait({'torque_request': request}, 5.0, needed=2)
    assert not wait.over(0.0)
    assert wait.missing == ['torque_request']
    request.count = 2
    assert wait.missing == []
