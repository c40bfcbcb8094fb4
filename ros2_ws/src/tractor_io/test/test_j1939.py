"""Identifiers and fields of J1939, against the examples of the standards' tables."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tractor_io.can.j1939 import GLOBAL, Identifier, Unknown, bits_of, meaning


def test_identifier_of_an_engine_by_hand():
    # EEC1 (61444, 0xF004) of the engine (0) at priority 3: 011 0 0 11110000 00000100 00000000.
    assert Identifier.parse(0x0CF00400) == (61444, 0, GLOBAL, 3)
    assert Identifier(61444, 0, priority=3).bits == 0x0CF00400


def test_identifier_with_a_destination_by_hand():
    # TSC1 (0) from 0x27 to the engine (0) at priority 3; format 0 is below 240.
    assert Identifier.parse(0x0C000027) == (0, 0x27, 0, 3)
    assert Identifier(0, 0x27, 0x11, 3).bits == 0x0C001127


@given(st.integers(0, 0x1FFFFFFF))
def test_identifiers_come_back(bits):
    assert Identifier.parse(bits).bits == bits


@pytest.mark.parametrize(
    ('identifier', 'text'),
    [
        (Identifier(0x40000, 1), 'pgn must be 0 to 262143, got 262144'),
        (Identifier(61444, 256), 'source must be 0 to 255, got 256'),
        (Identifier(61444, 1, priority=8), 'priority must be 0 to 7, got 8'),
        (Identifier(0x0001, 1, 0), 'pgn 1 has a destination: its last byte must be 0'),
        (Identifier(61444, 1, 3), 'pgn 61444 goes to everybody, not to 3'),
    ],
)
def test_identifiers_that_cannot_be(identifier, text):
    with pytest.raises(ValueError, match=text):
        _ = identifier.bits


@pytest.mark.parametrize('bits', [-1, 1 << 29])
def test_identifiers_of_other_lengths(bits):
    with pytest.raises(ValueError, match='identifier must have 29 bits'):
        Identifier.parse(bits)


@pytest.mark.parametrize(
    ('raw', 'length', 'expected'),
    [
        (0, 2, 0), (1, 2, 1), (2, 2, Unknown.ERROR), (3, 2, Unknown.NOT_AVAILABLE),
        (5, 3, 5), (6, 3, Unknown.ERROR), (7, 3, Unknown.NOT_AVAILABLE),
        (0xFA, 8, 0xFA), (0xFB, 8, Unknown.ERROR), (0xFE, 8, Unknown.ERROR),
        (0xFF, 8, Unknown.NOT_AVAILABLE), (0xFAFF, 16, 0xFAFF), (0xFB00, 16, Unknown.ERROR),
        (0xFE00, 16, Unknown.ERROR), (0xFF00, 16, Unknown.NOT_AVAILABLE),
        (0xFAFFFFFF, 32, 0xFAFFFFFF), (0xFE123456, 32, Unknown.ERROR),
        (0xFFFFFFFF, 32, Unknown.NOT_AVAILABLE),
    ],
)  # fmt: skip
def test_what_bits_say(raw, length, expected):
    assert meaning(raw, length) == expected


@pytest.mark.parametrize('length', [2, 3, 4, 5, 6, 7, 8, 16, 32])
@pytest.mark.parametrize('unknown', list(Unknown))
def test_what_is_unknown_comes_back(length, unknown):
    assert meaning(bits_of(unknown, length), length) is unknown
