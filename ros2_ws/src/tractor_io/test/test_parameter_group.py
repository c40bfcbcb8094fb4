"""Frames to values and back, by hand and at random; errors."""

import math
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tractor_io.can.j1939 import Identifier, Unknown
from tractor_io.can.parameter_group import FrameError, ParameterGroups, tractor_groups

GROUPS = tractor_groups()
PGNS = {
    'WBSD': 65096, 'GBSD': 65097, 'MSS': 61474, 'RHS': 65093, 'FHS': 65094, 'HRW': 65134,
    'EBC2': 65215, 'EEC1': 61444, 'TSC1': 0, 'EAC1': 61446, 'VDC2': 61449,
}  # fmt: skip


def heard(name, data, source=0):
    identifier = GROUPS.identifier(name)._replace(source=source)
    return GROUPS.decode(identifier.bits, data)


def test_parameter_groups_are_those_of_the_standards():
    assert {name: GROUPS.identifier(name).pgn for name in PGNS} == PGNS


def test_wheel_based_speed_by_hand():
    # 2.5 m/s is 2500 = 0x09C4; 10 m is 10000 = 0x2710; forward, the key on, the rest unknown:
    # 01 in bits 0 and 1, 01 in 2 and 3, ones: 1111 0101.
    data = bytes.fromhex('c409 10270000 ff f5')
    told = heard('WBSD', data)
    assert told.values['WheelBasedMachineSpeed'] == pytest.approx(2.5)
    assert told.values['WheelBasedMachineDistance'] == pytest.approx(10.0)
    assert told.values['WheelBasedMachineDirection'] == 1.0
    assert told.values['KeySwitchState'] == 1.0
    assert told.values['MaximumTimeOfTractorPower'] is Unknown.NOT_AVAILABLE
    assert told.values['StartStopOperations'] is Unknown.NOT_AVAILABLE
    sent = {
        'WheelBasedMachineSpeed': 2.5, 'WheelBasedMachineDistance': 10.0,
        'WheelBasedMachineDirection': 1, 'KeySwitchState': 1,
    }  # fmt: skip
    assert GROUPS.encode('WBSD', sent) == data


def test_units_are_si():
    # 36 km/h is 9216 = 0x2400 of 1/256 km/h, 10 m/s; 1500 rpm is 12000 = 0x2EE0, 50*pi rad/s;
    # 50 % is 175 - 125.
    wheels = heard('HRW', bytes.fromhex('0024 0000 ffff 00fe'))
    assert wheels.values['FrontAxleLeftWheelSpeed'] == pytest.approx(10.0)
    assert wheels.values['FrontAxleRightWheelSpeed'] == 0.0
    assert wheels.values['RearAxleLeftWheelSpeed'] is Unknown.NOT_AVAILABLE
    assert wheels.values['RearAxleRightWheelSpeed'] is Unknown.ERROR
    engine = heard('EEC1', bytes.fromhex('f2 ff af e02e ff ff ff'))
    assert engine.values['EngineSpeed'] == pytest.approx(50 * math.pi)
    assert engine.values['ActualEnginePercentTorque'] == pytest.approx(0.5)
    assert engine.values['EngineTorqueMode'] == 2.0
    # A draft of 12 kN is (12000 + 320000)/10 = 33200 = 0x81B0.
    hitch = heard('RHS', bytes.fromhex('ff ff ff b081 ff ff ff'))
    assert hitch.values['RearDraft'] == pytest.approx(12000.0)


def test_not_available_is_no_speed():
    # Scaled it would be 65.535 m/s.
    assert heard('GBSD', b'\xff' * 8).values['GroundBasedMachineSpeed'] is Unknown.NOT_AVAILABLE


def test_a_group_is_heard_from_anyone_at_any_priority():
    data = GROUPS.encode('GBSD', {'GroundBasedMachineSpeed': 1.0})
    for source in (0, 39, 254):
        for priority in (0, 3, 7):
            told = GROUPS.decode(Identifier(65097, source, priority=priority).bits, data)
            assert told.name == 'GBSD'
            assert told.identifier.source == source
            assert told.values['GroundBasedMachineSpeed'] == 1.0


def test_other_groups_are_not_ours():
    assert GROUPS.decode(Identifier(65265, 0).bits, b'\xff' * 8) is None


@given(name=st.sampled_from(list(PGNS)), data=st.binary(min_size=8, max_size=8))
def test_any_frame_is_read_and_written_alike(name, data):
    told = heard(name, data).values
    again = heard(name, GROUPS.encode(name, told)).values
    for field, value in told.items():
        assert again[field] is value if isinstance(value, Unknown) else again[field] == value
        assert isinstance(value, Unknown) or math.isfinite(value)


@given(st.integers(-(2**32), 2**32), st.binary(max_size=12))
def test_any_bytes_are_read_or_refused(identifier, data):
    with suppress(FrameError):
        GROUPS.decode(identifier, data)


@pytest.mark.parametrize(
    ('name', 'values', 'text'),
    [
        ('WBDS', {}, "unknown message 'WBDS': there are WBSD,"),
        ('WBSD', {'Speed': 1.0}, "WBSD has no field 'Speed'"),
        ('WBSD', {'WheelBasedMachineSpeed': 64.3}, 'WBSD WheelBasedMachineSpeed cannot be 64.3'),
        ('WBSD', {'WheelBasedMachineSpeed': -0.1}, 'cannot be -0.1'),
        ('WBSD', {'WheelBasedMachineSpeed': math.nan}, 'cannot be nan'),
        ('WBSD', {'WheelBasedMachineDirection': 2}, 'cannot be 2'),
        ('TSC1', {'EngineRequestedTorque': 1.26}, 'cannot be 1.26'),
        ('TSC1', {'EngineOverrideControlMode': Unknown.ERROR}, 'cannot be error'),
    ],
)
def test_values_that_do_not_fit(name, values, text):
    with pytest.raises(FrameError, match=text):
        GROUPS.encode(name, values)


def test_periods_are_those_of_the_standards():
    assert GROUPS.period('TSC1') == pytest.approx(0.01)
    assert GROUPS.period('HRW') == pytest.approx(0.02)
    assert GROUPS.period('EAC1') == pytest.approx(0.5)


CYCLE = 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;\nBA_DEF_DEF_ "GenMsgCycleTime" 100;\n'


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('nonsense', 'tractor.dbc'),
        ('VERSION "no cycle"\nBU_: A\nBO_ 2365475070 X: 8 A\n', 'X has no GenMsgCycleTime'),
        ('VERSION ""\nBU_: A\nBO_ 2365475070 X: 4 A\n SG_ Y : 0|8@1+ (1,0) [0|1] "m" A\n',
         'X is no J1939 frame of 8 bytes'),
        ('VERSION ""\nBU_: A\nBO_ 2365475070 X: 8 A\n SG_ Y : 0|8@1+ (1,0) [0|1] "furlong" A\n',
         "X Y: unknown unit 'furlong'"),
        ('VERSION ""\nBU_: A\nBO_ 2365475070 X: 8 A\n SG_ Y : 0|8@1- (1,0) [0|1] "m" A\n',
         'X Y is no J1939 field'),
    ],
)  # fmt: skip
def test_files_that_are_not_understood(tmp_path, text, said):
    path = tmp_path / 'tractor.dbc'
    path.write_text(text + ('' if 'no cycle' in text else CYCLE))
    with pytest.raises(FrameError, match=said):
        ParameterGroups(path)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(FrameError, match=r'none\.dbc'):
        ParameterGroups(tmp_path / 'none.dbc')
