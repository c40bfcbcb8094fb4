"""Import of CSV files: conversions calculated by hand, and errors with their place."""

import math
import tracemalloc
from pathlib import Path

import pytest

from tractor_io.bags.bag_error import BagError
from tractor_io.bags.csv_import import CsvImportError, CsvMap, find_map, import_csv
from tractor_io.bags.message_types import typestore
from tractor_io.bags.reader import BagReader

FIELD = Path(__file__).resolve().parents[5] / 'shared' / 'data' / 'field'
needs_field_data = pytest.mark.skipif(
    not FIELD.is_dir(), reason=f'{FIELD} is not here: field data may not be copied'
)

MAP = """
vehicle: tractor_4wd
soil: dry_sand
wheel_names: [fl, rl]
time: {column: t, unit: ms, start: 1.0}
topics:
  wheel_states:
    frame_id: base_link
    fields:
      velocity: {column: speed, unit: km/h, rolling_radius: [0.5, 0.8]}
      effort: {column: torque, unit: '%', scale: 2000}
  radar:
    fields:
      twist.twist.linear.x: {column: ground, unit: km/h}
      twist.covariance[0]: 0.01
"""
CSV = 't,speed,torque,ground\n0,36,50,18\n100.5,72,25,9\n'


def files(folder, table=CSV, text=MAP):
    """Write a table and its map."""
    (folder / 'log.csv').write_text(table)
    (folder / 'map.yaml').write_text(text)
    return folder / 'log.csv', folder / 'map.yaml', folder / 'bag'


def messages(path, topic):
    with BagReader(path) as bag:
        return [(m.time, m.message) for m in bag.messages([topic])]


def test_units_become_si(tmp_path):
    found = import_csv(*files(tmp_path))
    assert found.counts == {'/wheel_states': 2, '/radar': 2}
    assert (found.rows, found.start, found.end) == (2, 1_000_000_000, 1_100_500_000)
    (t0, first), (t1, second) = messages(found.path, 'wheel_states')
    assert (t0, t1) == (1_000_000_000, 1_100_500_000)
    assert (second.header.stamp.sec, second.header.stamp.nanosec) == (1, 100_500_000)
    assert first.header.frame_id == 'base_link'
    assert first.name == ['fl', 'rl']
    # 36 km/h are 10 m/s: 20 rad/s on 0.5 m, 12.5 rad/s on 0.8 m.
    assert first.velocity == pytest.approx([20.0, 12.5])
    # 72 km/h are 20 m/s.
    assert second.velocity == pytest.approx([40.0, 25.0])
    # 50 % and 25 % of 2000 N·m.
    assert first.effort == pytest.approx([1000.0, 1000.0])
    assert second.effort == pytest.approx([500.0, 500.0])
    (_, radar), _ = messages(found.path, 'radar')
    assert radar.twist.twist.linear.x == pytest.approx(5.0)
    assert radar.twist.covariance.tolist() == [0.01] + 35 * [0.0]
    with BagReader(found.path) as bag:
        assert bag.custom_data == {'vehicle': 'tractor_4wd', 'soil': 'dry_sand'}
        assert not bag.topics['/radar'].qos.reliable


@pytest.mark.parametrize(
    ('unit', 'field', 'told', 'expected'),
    [
        ('rpm', 'velocity', 60.0, 2 * math.pi),
        ('rev/s', 'velocity', 2.0, 4 * math.pi),
        ('deg/s', 'velocity', 180.0, math.pi),
        ('kN·m', 'effort', 1.5, 1500.0),
        ('kN*m', 'effort', 1.5, 1500.0),
        ('lbf*ft', 'effort', 1.0, 0.3048 * 0.45359237 * 9.80665),
        ('mph', 'twist.twist.linear.x', 10.0, 4.4704),
        ('kn', 'twist.twist.linear.x', 3600.0, 1852.0),
    ],
)
def test_units_by_hand(tmp_path, unit, field, told, expected):
    topic = 'wheel_states' if field in ('velocity', 'effort') else 'radar'
    text = f"""
wheel_names: [w]
time: {{rate: 10, start: 1}}
topics:
  {topic}: {{fields: {{{field}: {{column: x, unit: {unit}}}}}}}
"""
    bag = import_csv(*files(tmp_path, f'x\n{told}\n', text)).path
    [(_, message)] = messages(bag, topic)
    value = message.twist.twist.linear.x if topic == 'radar' else getattr(message, field)[0]
    assert value == pytest.approx(expected, rel=1e-12)


def test_a_rate_makes_times_that_do_not_drift(tmp_path):
    text = MAP.replace('{column: t, unit: ms, start: 1.0}', '{rate: 3, start: 2}')
    table = 'speed,torque,ground\n' + 31 * '1,2,3\n'
    found = import_csv(*files(tmp_path, table, text))
    assert (found.start, found.end) == (2_000_000_000, 12_000_000_000)


def test_times_near_the_present_date_are_exact(tmp_path):
    text = MAP.replace('unit: ms, start: 1.0', 'unit: s')
    table = CSV.replace('\n0,', '\n1700000000.123456789,').replace('100.5,', '1700000000.2,')
    assert import_csv(*files(tmp_path, table, text)).start == 1_700_000_000_123_456_789


def test_rows_with_empty_cells_can_be_skipped(tmp_path):
    text = MAP.replace('  radar:', '  radar:\n    skip_empty: true')
    found = import_csv(*files(tmp_path, CSV.replace(',18', ','), text))
    assert found.counts == {'/wheel_states': 2, '/radar': 1}


def test_a_mark_at_the_beginning_and_blank_lines_do_no_harm(tmp_path):
    table, text, bag = files(tmp_path)
    table.write_bytes(b'\xef\xbb\xbf' + CSV.replace('\n', '\r\n').encode() + b'\r\n')
    assert import_csv(table, text, bag).rows == 2


@pytest.mark.parametrize(
    ('table', 'reason'),
    [
        (CSV.replace('72', 'fast'), "line 3, column 'speed': 'fast' is not a number"),
        (CSV.replace('72', 'nan'), "line 3, column 'speed': 'nan' is not finite"),
        (CSV.replace('72', '-inf'), "column 'speed': '-inf' is not finite"),
        (CSV.replace('72', '1_0'), "column 'speed': '1_0' is not a number"),
        (CSV.replace('72', ''), "line 3, column 'speed': '' is empty"),
        (CSV.replace('72', '1e308').replace('km/h', ''), None),
        (CSV.replace('25,9', '25,9,1'), 'line 3: 5 columns, the head has 4'),
        (CSV.replace('25,9', '25'), 'line 3: 3 columns, the head has 4'),
        (CSV.replace('speed', 'sped'), "no column 'speed'; did you mean 'sped'\\?"),
        (CSV.replace('ground', 'speed'), "several columns 'speed'"),
        (CSV.replace('100.5', '-1'), "column 't': '-1' is 0.001 s before the row above"),
        (CSV.replace('100.5', '-2000'), "'-2000' gives a stamp of -1 s"),
        (CSV.replace('100.5', '1e999999999'), "'1e999999999' is not finite"),
        (CSV.replace('100.5', '1e300'), "'1e300' is no time"),
        (CSV.replace('72', '"72'), 'unexpected end of data'),
        (CSV.replace('72', 'x' * 70_000), 'line 3: longer than 65536 characters'),
        ('', 'is empty'),
        ('t,speed,torque,ground\n', 'holds no rows'),
    ],
)
def test_faults_of_the_file_name_the_place(tmp_path, table, reason):
    table, text, bag = files(tmp_path, table)
    if reason is None:
        assert import_csv(table, text, bag).rows == 2
        return
    with pytest.raises(CsvImportError, match=reason) as fault:
        import_csv(table, text, bag)
    assert 'log.csv' in str(fault.value)
    # Neither a bag nor a temporary folder is left.
    assert sorted(p.name for p in tmp_path.iterdir()) == ['log.csv', 'map.yaml']


def test_what_is_no_text_or_missing_is_said(tmp_path):
    table, text, bag = files(tmp_path)
    table.write_bytes(CSV.encode('utf-16'))
    with pytest.raises(CsvImportError, match='not text in UTF-8'):
        import_csv(table, text, bag)
    with pytest.raises(CsvImportError, match=r'none\.csv: No such file'):
        import_csv(tmp_path / 'none.csv', text, bag)
    with pytest.raises(CsvImportError, match='No such file'):
        import_csv(table, tmp_path / 'none.yaml', bag)


@pytest.mark.parametrize(
    ('old', 'new', 'reason'),
    [
        ('soil:', 'soils:', "soils: unknown key; did you mean 'soil'"),
        ('unit: ms', 'unit: msec', "'msec' is no unit of time; did you mean 'ms'"),
        ('unit: km/h, roll', 'unit: kmh, roll', "unknown unit 'kmh'; did you mean 'km/h'"),
        ('radar:', 'rader:', "unknown topic 'rader'; did you mean 'radar'"),
        ('velocity', 'velocty', "has no field 'velocty'; did you mean 'velocity'"),
        ('linear.x', 'linear', 'is a message itself, of x, y, z'),
        ('covariance[0]', 'covariance[36]', 'has no element 36'),
        ('covariance[0]', 'covariance', None),
        ('[0.5, 0.8]', '[0.5]', '1 values for 2 wheels'),
        ('[0.5, 0.8]', '0', 'must be above 0 m'),
        ('unit: km/h, roll', 'unit: rpm, roll', 'turns m/s into rad/s, not rpm'),
        ('ground, unit: km/h', 'ground, unit: rpm', "must be a unit of m/s, 'rpm' is one of"),
        ('ground, unit: km/h', 'ground', 'names no unit'),
        ('ground, unit: km/h', 'ground, unit: km/h, scale: [1, 2]', 'must be one number'),
        (', unit: km/h}', ', unit: km/h, skale: 2}', "unknown key; did you mean 'scale'"),
        ('wheel_names: [fl, rl]', 'wheel_names: [fl, fl]', 'a name is given twice'),
        ('wheel_names: [fl, rl]', '', 'wheel_names: missing: wheel_states needs them'),
        ('time:', 'rate: 3\ntimes:', 'unknown key'),
        ('time: {', 'time: {rate: 3, ', 'either a column with its unit, or a rate'),
        ('0.01', '.nan', 'must be a finite number, got nan'),
        ('0.01', 'yes', 'must be a number, got True'),
        ('0.01', '*x', 'undefined alias'),
        ('0.01', '!!python/object/apply:os.getcwd []', 'could not determine a constructor'),
        ('0.01', '!!int x', 'a value cannot be read|not valid YAML'),
        ('0.01', 50 * '[' + 50 * ']', 'nested deeper than 32 levels'),
        ('0.01', 5000 * '9', 'value of more than 3000 characters'),
    ],
)
def test_faults_of_the_map_name_the_key(tmp_path, old, new, reason):
    assert old in MAP
    table, text, bag = files(tmp_path, text=MAP.replace(old, new, 1))
    if reason is None:
        import_csv(table, text, bag)
        return
    with pytest.raises(CsvImportError, match=reason) as fault:
        import_csv(table, text, bag)
    assert 'map.yaml' in str(fault.value)
    assert not bag.exists()


def test_a_bag_that_exists_is_kept(tmp_path):
    table, text, bag = files(tmp_path)
    import_csv(table, text, bag)
    before = (bag / 'bag.mcap').read_bytes()
    with pytest.raises(BagError, match='exists already'):
        import_csv(table, text, bag)
    assert (bag / 'bag.mcap').read_bytes() == before


def test_memory_does_not_grow_with_the_file(tmp_path):
    def peak(rows):
        table, text, _ = files(tmp_path)
        with table.open('w') as file:
            file.write('t,speed,torque,ground\n')
            file.writelines(f'{k},36,50,18\n' for k in range(rows))
        tracemalloc.start()
        try:
            import_csv(table, text, tmp_path / f'bag{rows}')
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(10)
    # Chunks are full in both cases; ten times the rows may only add to the index.
    short, long = peak(3_000), peak(30_000)
    assert long - short < 1_000_000


@needs_field_data
def test_the_tractor_of_the_field_data(tmp_path):
    shares = []
    found = import_csv(
        FIELD / 'tractor_t7165s.csv', find_map('import_t7165s'), tmp_path / 'bag', shares.append
    )
    assert set(found.counts) == {'/wheel_states', '/gnss_velocity'}
    assert len(set(found.counts.values())) == 1
    assert found.counts['/wheel_states'] == found.rows > 5000
    assert shares == sorted(shares)
    with (FIELD / 'tractor_t7165s.csv').open() as file:
        head = next(file).strip().split(',')
        rows = [dict(zip(head, line.strip().split(','), strict=True)) for line in file]
    k = next(k for k, row in enumerate(rows) if float(row['wheel_speed']) > 1.0)
    speed, torque = float(rows[k]['wheel_speed']), float(rows[k]['engine_torque'])
    time, message = messages(found.path, 'wheel_states')[k]
    assert time == 1_000_000_000 * (1 + int(rows[k]['t']))
    assert message.velocity == pytest.approx(2 * [speed / 0.65] + 2 * [speed / 0.85])
    assert message.effort == pytest.approx(2 * [27.0 * torque] + 2 * [63.0 * torque])


@needs_field_data
def test_the_rover_of_the_field_data(tmp_path):
    found = import_csv(FIELD / 'rover_pathfinder.csv', find_map('import_rover'), tmp_path / 'bag')
    assert found.counts == {'/wheel_states': 705, '/gnss': 705}
    last = (FIELD / 'rover_pathfinder.csv').read_text().split()[-1].split(',')
    time, wheels = messages(found.path, 'wheel_states')[-1]
    assert time == 1_000_000_000 + round(float(last[0]) * 1e9)
    assert wheels.velocity == pytest.approx([float(cell) for cell in last[1:5]])
    _, gnss = messages(found.path, 'gnss')[-1]
    place = gnss.pose.pose.position
    assert [place.x, place.y, place.z] == [float(cell) for cell in last[5:]]
    assert gnss.pose.covariance[14] == 0.0016


@pytest.mark.parametrize('name', ['import_t7165s', 'import_rover'])
def test_shipped_maps_are_in_order(name):
    known = CsvMap(find_map(name))
    assert known.wheel_names == ('fl', 'fr', 'rl', 'rr')
    assert set(known.topics.values()) <= set(typestore().fielddefs)
