"""Address claims of several devices on a simulated bus."""

import pytest

from tractor_io.can.address_claim import (
    ARBITRARY,
    CLAIMED_PGN,
    REQUEST_PGN,
    WAIT,
    AddressClaim,
    Claim,
    name_of,
)
from tractor_io.can.j1939 import GLOBAL, NULL, Identifier

LOW = name_of(identity=1, manufacturer=100, function=130)
HIGH = name_of(identity=2, manufacturer=100, function=130)
FIXED = name_of(identity=3, manufacturer=2047, function=130, arbitrary=False)


def settle(devices, t=0.0):
    """Start all devices, deliver frames until none is left, and let the claims end."""
    pending = [(device, frame) for device in devices for frame in device.start(t)]
    count = 0
    while pending:
        sender, (identifier, data) = pending.pop(0)
        for device in devices:
            if device is not sender:
                pending += [(device, frame) for frame in device.receive(t, identifier, data)]
        count += 1
        assert count < 100
    told = [frame for device in devices for frame in device.poll(t + WAIT + 0.01)]
    return told


def test_name_by_hand():
    # Arbitrary, group 2, function 130 = 0x82, manufacturer 100 << 21 = 0x0C800000, identity 1.
    assert LOW == 0xA000_8200_0C80_0001
    with pytest.raises(ValueError, match='manufacturer must be 0 to 2047, got 2048'):
        name_of(identity=1, manufacturer=2048, function=1)


def test_unchallenged_address_is_ones_own_after_a_quarter_second():
    device = AddressClaim(LOW, 0x80)
    ((identifier, data),) = device.start(1.0)
    assert identifier == (CLAIMED_PGN, 0x80, GLOBAL, 6)
    assert int.from_bytes(data, 'little') == LOW
    assert device.poll(1.0 + 0.9 * WAIT) == []
    assert not device.usable
    device.poll(1.0 + WAIT)
    assert device.usable
    assert device.address == 0x80


@pytest.mark.parametrize('turned', [False, True])
def test_lower_name_keeps_the_address(turned):
    low, high = AddressClaim(LOW, 0x80), AddressClaim(HIGH, 0x80)
    settle([high, low] if turned else [low, high])
    assert low.usable
    assert low.address == 0x80
    assert high.usable
    assert high.address in ARBITRARY
    assert high.address != 0x80


def test_many_devices_get_addresses_of_their_own():
    names = [name_of(identity=k, manufacturer=100, function=130) for k in range(8)]
    devices = [AddressClaim(name, 0x80) for name in names]
    settle(devices)
    assert len({device.address for device in devices}) == 8
    assert all(device.usable for device in devices)


def test_who_cannot_use_another_falls_silent():
    # Without the arbitrary bit FIXED has a low NAME; the other device needs a lower one.
    lower = FIXED - 1
    silent, other = AddressClaim(FIXED, 0x26), AddressClaim(lower, 0x26)
    told = settle([silent, other])
    assert other.usable
    assert silent.state is Claim.LOST
    assert silent.address == NULL
    assert [identifier.source for identifier, _ in told] == [NULL]
    # Sent once.
    assert silent.poll(10.0) == []


def test_address_lost_while_in_use():
    device = AddressClaim(HIGH, 0x80)
    settle([device])
    frames = device.receive(5.0, Identifier(CLAIMED_PGN, 0x80), LOW.to_bytes(8, 'little'))
    assert not device.usable
    assert [identifier.source for identifier, _ in frames] == [0x81] == [device.address]
    device.poll(5.0 + WAIT)
    assert device.usable


def test_request_is_answered():
    device = AddressClaim(LOW, 0x80)
    asked = CLAIMED_PGN.to_bytes(3, 'little')
    assert device.receive(0.0, Identifier(REQUEST_PGN, 1, GLOBAL), asked) == []
    settle([device])
    for destination in (GLOBAL, 0x80):
        ((identifier, data),) = device.receive(2.0, Identifier(REQUEST_PGN, 1, destination), asked)
        assert identifier.source == 0x80
        assert int.from_bytes(data, 'little') == LOW
    assert device.receive(2.0, Identifier(REQUEST_PGN, 1, 0x22), asked) == []
    assert device.receive(2.0, Identifier(REQUEST_PGN, 1), (65265).to_bytes(3, 'little')) == []


def test_other_frames_change_nothing():
    device = AddressClaim(HIGH, 0x80)
    settle([device])
    for identifier, data in (
        (Identifier(CLAIMED_PGN, 0x80), LOW.to_bytes(8, 'little')[:7]),
        (Identifier(CLAIMED_PGN, NULL), LOW.to_bytes(8, 'little')),
        # Echo of the own claim.
        (Identifier(CLAIMED_PGN, 0x80), HIGH.to_bytes(8, 'little')),
        (Identifier(61444, 0x80), b'\xff' * 8),
    ):
        assert device.receive(1.0, identifier, data) == []
        assert device.usable


@pytest.mark.parametrize('address', [-1, 254, 255])
def test_addresses_that_cannot_be_claimed(address):
    with pytest.raises(ValueError, match='preferred must be an address of 0 to 253, got'):
        AddressClaim(LOW, address)
