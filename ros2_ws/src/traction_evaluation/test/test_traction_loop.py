"""The loop of the evaluation against the nodes in lock step, and parameters as they ship."""

from pathlib import Path

import numpy as np
import pytest

from traction_evaluation.closed_loop.controllers import (
    Controller,
    controllers,
    fixed_pi,
    limiting,
)
from traction_evaluation.closed_loop.report import written_digest
from traction_evaluation.loop.shipped import (
    differences,
    digest,
    shipped_parameters,
)
from traction_evaluation.loop.traction_loop import TractionLoop
from traction_evaluation.replay.replay import replay
from traction_node.stamp import nanoseconds
from tractor_io.bags.reader import BagReader
from tractor_io.bags.repair import cut_bag

ROOT = Path(__file__).resolve().parents[4]


def test_the_loop_gives_the_torques_of_the_replay(tmp_path):
    bag_path = tmp_path / 'bag'
    cut_bag(ROOT / 'bags' / 'tractor_soft_patch', bag_path, end=8.0)
    replayed = {
        nanoseconds(each.header.stamp): list(each.effort)
        for each in replay(bag_path).values('wheel_torque')
    }
    loop = TractionLoop.from_parameters(shipped_parameters())
    found = {}
    with BagReader(bag_path) as bag:
        for each in bag.messages(['wheel_states', 'radar', 'wheel_torque']):
            message, stamp = each.message, nanoseconds(each.message.header.stamp)
            t = steady = (stamp - bag.start) * 1e-9
            if each.topic == '/wheel_states':
                found[stamp] = loop.wheel_states(
                    t, steady, message.velocity.tolist(), message.effort.tolist()
                )
            elif each.topic == '/radar':
                loop.radar(t, message.twist.twist.linear.x, message.twist.covariance[0])
            else:
                # Without a torque_request in the bag, the commanded torque is the request.
                loop.torque_request(steady, message.effort.tolist())
    assert len(found) == 801
    stamps = sorted(found.keys() & replayed.keys())
    assert len(stamps) >= 800
    torques = np.array([found[stamp] for stamp in stamps])
    assert np.abs(torques).max() > 1000.0
    # The replay counts time from the first stamp, to a rounding of 1e-16 s.
    np.testing.assert_allclose(torques, [replayed[stamp] for stamp in stamps], rtol=1e-9)


def test_the_loop_is_made_of_the_parameters():
    parameters = shipped_parameters(
        changes={
            'slip_controller': {'slip_target': 0.11, 'hold_torque': [1000.0]},
            'torque_gate': {'max_torque': [900.0]},
            'slip_estimator': {'method': 'ekf'},
        }
    )
    loop = TractionLoop.from_parameters(parameters)
    assert loop.controller.control.slip_target == 0.11
    assert loop.controller.control.hold_torque == [1000.0] * 4
    loop.gate.command(0.0, 0.0, ('fl', 'fr', 'rl', 'rr'), [2000.0] * 4)
    loop.gate.command(1.0, 1.0, ('fl', 'fr', 'rl', 'rr'), [2000.0] * 4)
    assert max(loop.gate.output) <= 900.0


def test_differences_are_named():
    assert differences(shipped_parameters()) == {}
    lpv = controllers(fixed_pi(1.0, 1.0))[-1]
    # Twice static load times radius: 7799 N at 0.65 m, 13979 N at 0.85 m.
    ample = (10100.0, 10100.0, 23800.0, 23800.0)
    assert differences(lpv.parameters) == {
        'slip_controller.mode': 'hold',
        'slip_controller.hold_torque': ample,
        'torque_gate.max_torque': ample,
    }
    assert differences(limiting(lpv).parameters) == {}
    with pytest.raises(ValueError, match=r'no reason is given why slip_controller\.rate differs'):
        _ = Controller('other', (('slip_controller.rate', 50.0),)).parameters


def test_unknown_node_is_refused():
    with pytest.raises(ValueError, match="no node 'slip_estimatr'; did you mean 'slip_estimator'"):
        shipped_parameters(changes={'slip_estimatr': {}})


def test_report_was_written_by_what_ships():
    """Otherwise `make evaluate` is to be run again."""
    assert written_digest(ROOT / 'docs' / 'control.md') == digest()
