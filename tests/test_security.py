"""The SROS2 policy against the running graph: all that a node does, and nothing else."""

import contextlib
from xml.etree import ElementTree

import pytest
from rclpy.node import NodeNameNonExistentError

from traction_bringup.system import system
from traction_node.parameter_file import config
from traction_node.probe import NodeProcess, Probe, executable
from traction_node.running_system import RunningSystem
from traction_node.topics import topics
from tractor_io.bags.message_types import typestore, zero_message
from tractor_io.bags.writer import BagWriter
from tractor_io.can.interface import free_port

PARAMETER_SERVICES = ('get_parameters', 'list_parameters')


def read_policy():
    """By node: sets of full names that it may publish, subscribe, reply and request."""
    root = ElementTree.parse(config('traction_bringup', 'security/policy.xml')).getroot()
    assert (root.tag, root.get('version')) == ('policy', '0.2.0')
    found = {}
    for enclave in root.iterfind('enclaves/enclave'):
        [profile] = enclave.iterfind('profiles/profile')
        node, namespace = profile.get('node'), profile.get('ns')
        assert enclave.get('path') == f'/{node}'
        assert node not in found
        allowed = found[node] = {}
        for block in profile:
            [(action, rule)] = block.attrib.items()
            assert (block.tag, rule) in (('topics', 'ALLOW'), ('services', 'ALLOW'))
            names = [name.text if name.text[0] == '/' else namespace + name.text for name in block]
            assert len(names) == len(set(names))
            allowed[action] = set(names)
    return found


POLICY = read_policy()


def graph_of(node, name):
    """What a running node does, as `read_policy` gives it; nothing that it does not do."""
    asked = {
        'subscribe': node.get_subscriber_names_and_types_by_node,
        'publish': node.get_publisher_names_and_types_by_node,
        'reply': node.get_service_names_and_types_by_node,
        'request': node.get_client_names_and_types_by_node,
    }
    return {action: {topic for topic, _ in ask(name, '/')} for action, ask in asked.items()}


@pytest.fixture(scope='module')
def graph(tmp_path_factory):
    """By node: all that is done with a bus in between or without."""
    found = {}
    for can in ('', 'udp_multicast'):
        bus = {'interface': can, 'port': free_port()}
        nodes = system(
            simulated=True,
            can=can,
            bag=tmp_path_factory.mktemp('security') / 'bag',
            parameters={'can_bridge': bus, 'tractor_ecu': bus} if can else {},
        )
        with RunningSystem(nodes) as running:
            names = [node.name for node in nodes]

            # The name of a node and its services may be discovered after its diagnostics.
            def known(running=running, names=names):
                with contextlib.suppress(NodeNameNonExistentError):
                    return all(
                        f'/{name}/get_type_description'
                        in graph_of(running.probe.node, name)['reply']
                        for name in names
                    )

            running.probe.wait_for(known, 'whole graph')
            for name in names:
                for action, things in graph_of(running.probe.node, name).items():
                    found.setdefault(name, {}).setdefault(action, set()).update(things)
    return found


@pytest.mark.parametrize('name', sorted(POLICY.keys() - {'bag_player'}))
def test_policy_is_what_the_node_does(graph, name):
    for action in ('subscribe', 'publish', 'reply'):
        assert POLICY[name].get(action, set()) == graph[name][action], (name, action)


def test_every_node_has_a_policy(graph):
    assert graph.keys() | {'bag_player'} == POLICY.keys()


def test_the_recorder_alone_asks_and_for_parameters_alone(graph):
    wanted = {f'/{name}/{service}' for name in POLICY for service in PARAMETER_SERVICES}
    assert {name for name, allowed in POLICY.items() if 'request' in allowed} == {'bag_recorder'}
    assert POLICY['bag_recorder']['request'] == wanted
    # It asks for a moment only, so that the graph may show none of it.
    for name, done in graph.items():
        assert done['request'] <= POLICY[name].get('request', set())


@pytest.mark.nightly
def test_policy_of_the_player_is_all_that_it_plays_without_being_told(tmp_path):
    path = tmp_path / 'bag'
    with BagWriter(path) as bag:
        for name, row in topics().items():
            bag.add_topic(f'/{name.lstrip("/")}', row.type)
        # There must be something to loop.
        for ns in (0, 10**9):
            bag.write('/slip_target', ns, zero_message(typestore(), topics()['slip_target'].type))
    parameters = {'bag': path, 'clock': True, 'loop': True, 'wait_for_subscribers': 60.0}
    with (
        NodeProcess(executable('tractor_io', 'bag_player'), params=parameters),
        Probe() as probe,
    ):
        probe.wait_for(lambda: probe.diagnostics('bag_player'), 'sign of life')
        probe.wait_for(lambda: '/clock' in graph_of(probe.node, 'bag_player')['publish'], 'topics')
        done = graph_of(probe.node, 'bag_player')
    assert done == {action: POLICY['bag_player'].get(action, set()) for action in done}
