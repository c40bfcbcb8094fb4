"""Choice of the executor: the fast one where it works, the safe one otherwise."""

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor

from traction_node import run
from traction_node.behaviour import Behaviour


class Idle(Behaviour):
    NAME = 'idle'


class NeverFires(SingleThreadedExecutor):
    """Comes back without having run a callback."""

    def spin_until_future_complete(self, future, timeout_sec=None):
        pass


class Raises(SingleThreadedExecutor):
    """Gives up as the bindings do."""

    def spin_until_future_complete(self, future, timeout_sec=None):
        raise RuntimeError('no events')


@pytest.fixture
def node():
    rclpy.init(args=[])
    node = run.make_node(Idle)
    yield node
    node.destroy_node()
    rclpy.shutdown()


class Works(SingleThreadedExecutor):
    pass


class WorksLate(SingleThreadedExecutor):
    """Gets a core only after a second."""

    def spin_until_future_complete(self, future, timeout_sec=None):
        if timeout_sec > 1.0:
            super().spin_until_future_complete(future, timeout_sec)


@pytest.mark.parametrize('working', [Works, WorksLate])
def test_working_executor_is_taken(node, monkeypatch, working):
    monkeypatch.setattr(run, 'EventsExecutor', working)
    assert type(run.executor_for(node)) is working


@pytest.mark.parametrize('broken', [NeverFires, Raises, None])
def test_broken_or_absent_executor_is_replaced(node, monkeypatch, broken):
    monkeypatch.setattr(run, 'EventsExecutor', broken)
    executor = run.executor_for(node)
    assert type(executor) is SingleThreadedExecutor
    assert run.self_test(executor, node)


def test_events_that_wait_when_their_entity_is_destroyed_reach_nobody(node):
    """As an executor has them in its queue: a node that is cleaned up has no state for them."""
    heard = []
    subscription = node.subscription('slip_target', heard.append)
    timer = node.steady_timer(10.0, lambda: heard.append('timer'))
    subscription.callback('message')
    timer.callback()
    assert heard == ['message', 'timer']
    node._destroy_entities()
    subscription.callback('late message')
    timer.callback()
    assert heard == ['message', 'timer']
