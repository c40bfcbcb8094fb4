"""Damaged and hostile input: only the documented errors, no torque out of range, flat memory.

`make test` runs a hundredth of the cases, `make fuzz` all of them. A case follows from seed,
target and number alone; a failure names all three, and what to set to run that case again.
"""

import math
import os
import random
import sqlite3
import struct
import time
import tracemalloc
from collections import Counter
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import numpy as np
import psutil
import pytest
import zstandard
from ament_index_python.packages import get_package_share_directory
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

from torque_gate.gate import State, TorqueGate
from traction_controller.synthesis.gain_table import GainTableError, read_gain_table
from traction_model.definition import DefinitionError
from traction_model.simulation.sweep import read_sweep
from traction_model.soil.soil import load_soil
from traction_model.soil.terrain import load_terrain
from traction_model.vehicle.vehicle import load_vehicle
from traction_node.bounded_yaml import BoundedYamlError
from traction_node.joints import JointError, JointOrder
from traction_node.parameter_file import read_entries
from tractor_io.bags.bag_error import BagError
from tractor_io.bags.csv_import import CsvImportError, CsvMap, find_map, import_csv
from tractor_io.bags.message_types import typestore
from tractor_io.bags.reader import BagReader
from tractor_io.bags.repair import repair_bag
from tractor_io.bags.writer import BagWriter
from tractor_io.can.address_claim import AddressClaim
from tractor_io.can.drivetrain import Drivetrain
from tractor_io.can.ecu import TractorEcu
from tractor_io.can.j1939 import Unknown
from tractor_io.can.parameter_group import FrameError, tractor_groups
from tractor_io.can.torque_limit import HIGHEST, LimitReader
from tractor_io.can.vehicle_bus import VehicleBus

ROOT = Path(__file__).resolve().parents[1]
BAG = ROOT / 'bags' / 'wheel_drawbar'
PRESETS = ROOT / 'ros2_ws' / 'src' / 'traction_model' / 'traction_model' / 'presets'

SHARE = float(os.environ.get('TRACTION_FUZZ_SHARE', '0.01'))
SEED = int(os.environ.get('TRACTION_FUZZ_SEED', '1'))
ONLY = os.environ.get('TRACTION_FUZZ_CASE', '')

# Most that resident memory may grow from a tenth of the cases on, bytes.
GROWTH = 32 * 1024 * 1024
# Longest that one case may take, s.
LONGEST = 10.0

MIB = 1024 * 1024
RESULTS: dict[str, 'Outcome'] = {}


@dataclass
class Outcome:
    """Result of the cases of a target."""

    cases: int = 0
    accepted: int = 0
    refused: Counter = field(default_factory=Counter)
    seconds: float = 0.0
    slowest: float = 0.0
    growth: int = 0


def run(name, count, make, use, documented, folder):
    """Run the cases of a target; other exceptions fail, with the command to repeat the case."""
    outcome = RESULTS[name] = Outcome()
    total = max(1, round(count * SHARE))
    numbers = range(total)
    if ONLY:
        chosen, _, number = ONLY.partition(':')
        if chosen != name:
            pytest.skip(f'only case {ONLY} is asked for')
        numbers = [int(number)]
    memory = psutil.Process().memory_info
    settled = memory().rss
    begun = time.perf_counter()
    with Progress(console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task(name, total=total)
        for k in numbers:
            # A separate generator for every case, so that each can be run alone.
            case = make(random.Random(f'{SEED}/{name}/{k}'))
            started = time.perf_counter()
            silent = False
            try:
                use(case)
                outcome.accepted += 1
            except documented as error:
                outcome.refused[type(error).__name__] += 1
                silent = not str(error).strip()
            except BaseException as error:
                place = folder / f'{name.replace(" ", "_")}_{k}.txt'
                place.write_text(repr(case))
                raise AssertionError(
                    f'{name}: case {k} of seed {SEED}: {error!r}; input {short(case)}, all of it '
                    f"in {place}; again: TRACTION_FUZZ_SEED={SEED} TRACTION_FUZZ_CASE='{name}:{k}'"
                ) from error
            assert not silent, f'{name}: case {k} of seed {SEED}: an error without a text'
            spent = time.perf_counter() - started
            outcome.slowest = max(outcome.slowest, spent)
            assert spent < LONGEST, f'{name}: case {k} of seed {SEED} took {spent:.1f} s'
            outcome.cases += 1
            if k == total // 10:
                settled = memory().rss
            if k % 50 == 0:
                progress.update(bar, completed=k)
    outcome.seconds = time.perf_counter() - begun
    outcome.growth = memory().rss - settled
    assert outcome.growth < GROWTH, f'{name}: memory grew by {outcome.growth / MIB:.1f} MiB'


def short(case):
    text = repr(case)
    return text if len(text) < 300 else f'{text[:300]}…'


@pytest.fixture(scope='module', autouse=True)
def report():
    """Show the table of all targets, where output is shown."""
    yield
    table = Table(title=f'fuzzing, seed {SEED}, {100 * SHARE:g} % of the cases')
    for heading in ('target', 'cases', 'accepted', 'refused', 'ms a case', 'slowest', 'memory'):
        table.add_column(heading, justify='left' if heading in ('target', 'refused') else 'right')
    for name, found in RESULTS.items():
        refused = ', '.join(f'{kind} {n}' for kind, n in sorted(found.refused.items()))
        table.add_row(
            name, str(found.cases), str(found.accepted), refused,
            f'{1e3 * found.seconds / max(1, found.cases):.3f}', f'{found.slowest:.2f} s',
            f'{found.growth / MIB:+.1f} MiB',
        )  # fmt: skip
    Console(width=120).print(table)


# Mutations

SIZES = [0, 1, 0x7F, 0xFF, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 2**60, 2**63 - 1, 2**63, 2**64 - 1]


def mutated(r, data):
    """Bytes with one to four faults: cut, flipped, inserted, taken out, repeated, overwritten."""
    data = bytearray(data)
    for _ in range(r.choice([1, 1, 2, 4])):
        at = r.randrange(len(data) + 1)
        kind = r.randrange(7)
        if kind == 0 and r.random() < 0.3:
            del data[at:]
        elif kind == 1 and at < len(data):
            data[at] ^= 1 << r.randrange(8)
        elif kind == 2:
            data[at:at] = r.randbytes(r.randint(1, 16))
        elif kind == 3:
            del data[at : at + r.randint(1, 64)]
        elif kind == 4:
            data[at:at] = data[at : at + r.randint(1, 256)]
        elif kind == 5:
            data[at : at + 8] = struct.pack('<Q', r.choice(SIZES))
        elif kind == 6:
            data[at : at + 4] = struct.pack('<I', r.choice(SIZES) & 0xFFFFFFFF)
        if not data:
            break
    return bytes(data)


HOSTILE = [
    '.nan', '.inf', '-.inf', '-1', '0', '1e308', '-1e308', '1e-320', '9' * 400, '9' * 5000,
    '0x' + 'f' * 300, 'null', '~', '[]', '{}', "''", 'yes', 'no', '1:30:00', '2024-13-45',
    '2024-01-01', '!!python/object/apply:os.getcwd []', '!!int x', '!!float ""', '!!bool x',
    '!!binary "%"', '!!timestamp x', '!!set {a, b}', '!!omap [a]', '*x', '&x [*x]',
    '&x {<<: *x}', '[' * 40 + ']' * 40, '[' * 3000, '{a: ' * 30 + '1' + '}' * 30, '"\\ud800"',
    '"\\0"', '\u2028', '\x00', '? [a, b]', '- - - x', '<<: 1', '1', 'x', '"1"', '[1, x]', '{1: 2}',
    '{[1]: 2}', '[.nan]', '1_000', '0o17', '+.INF', '18446744073709551616',
]  # fmt: skip


def hostile_text(r, text):
    """A text with faults of its structure: values replaced, lines moved, or of its bytes."""
    if r.random() < 0.2:
        return mutated(r, text.encode())
    lines = text.split('\n')
    for _ in range(r.choice([1, 1, 1, 2, 3])):
        k = r.randrange(len(lines))
        kind = r.randrange(8)
        if kind < 3 and ':' in lines[k]:
            key, _, _ = lines[k].partition(':')
            lines[k] = f'{key}: {r.choice(HOSTILE)}'
        elif kind < 5:
            words = lines[k].replace(',', ' , ').replace('}', ' }').replace(']', ' ]').split(' ')
            words[r.randrange(len(words))] = r.choice(HOSTILE)
            lines[k] = ' '.join(words)
        elif kind == 5:
            lines[k : k + 1] = [lines[k]] * r.choice([0, 2, 3])
        elif kind == 6:
            lines[k] = ' ' * r.randrange(6) + lines[k].lstrip()
        else:
            other = r.randrange(len(lines))
            lines[k], lines[other] = lines[other], lines[k]
        if not lines:
            break
    return '\n'.join(lines).encode('utf-8', 'replace')


# CAN


def frame(r):
    """Any frame, or one near those that are understood."""
    kind = r.randrange(4)
    if kind == 0:
        return r.getrandbits(32), r.randbytes(r.randrange(12))
    pgn = r.choice(PGNS)
    identifier = r.randrange(8) << 26 | pgn << 8 | r.choice([0, 0x27, 240, 254, 255])
    if pgn >> 8 < 240:
        identifier |= r.choice([0, 0x27, 0x80, 255]) << 8
    data = r.choice([r.randbytes(8), b'\xff' * 8, b'\x00' * 8, bytes([r.randrange(256)]) * 8])
    if kind == 1:
        data = data[: r.randrange(9)]
    return identifier, data


NAMES = (
    'WBSD', 'GBSD', 'MSS', 'RHS', 'FHS', 'HRW', 'EBC2', 'EEC1', 'TSC1', 'EAC1', 'VDC2',
)  # fmt: skip
PGNS = [tractor_groups().identifier(name).pgn for name in NAMES] + [0xEE00, 0xEA00]


class Bus:
    """Tractor and suite on one bus, with the same frames."""

    def __init__(self):
        drivetrain = Drivetrain([True, True, False, False], 500.0, 40.0, 0.9, 0.3)
        radii = [0.65, 0.65, 0.85, 0.85]
        self.groups = tractor_groups()
        self.ecu = TractorEcu(self.groups, radii, drivetrain)
        self.bus = VehicleBus(self.groups, radii, drivetrain, AddressClaim(0x123456789, 0x27))
        self.most = drivetrain.full_torque * HIGHEST
        self.t = 0.0
        self.ecu.ask([1e4] * 4)
        self.bus.begin(0.0)
        self.readers = {}

    def take(self, case):
        identifier, data = case
        self.t += 0.001
        try:
            group = self.groups.decode(identifier, data)
            if group is not None:
                for value in group.values.values():
                    assert isinstance(value, Unknown) or math.isfinite(value)
                if group.name == 'TSC1':
                    reader = self.readers.setdefault(group.identifier.source, LimitReader())
                    limit = reader.read(group, data)
                    assert limit is None or -HIGHEST <= limit <= HIGHEST
        finally:
            self.ecu.take(self.t, identifier, data)
            self.check_torques()
            self.bus.take(self.t, identifier, data)
            self.check_bus()

    def check_torques(self):
        total = float(np.sum(self.ecu.wheel_torques(self.t)))
        assert 0.0 <= total <= self.most * (1 + 1e-9)

    def check_bus(self):
        for value in (*self.bus.wheel_speeds(self.t), self.bus.ground_speed(self.t)):
            assert isinstance(value, Unknown) or math.isfinite(value)
        torques = self.bus.shaft_torques(self.t)
        assert torques is None or np.all(np.isfinite(torques))
        self.bus.command(self.t, [1000.0] * 4)
        assert 0.0 <= self.bus.limit(self.t) <= HIGHEST
        for identifier, data in self.bus.outgoing(self.t):
            assert self.groups.decode(identifier, data) is None or len(data) == 8


def test_frames(tmp_path):
    bus = Bus()
    run('CAN frames', 1_000_000, frame, bus.take, FrameError, tmp_path)


# Bags


def small_bag(folder):
    """The first messages of a real bag, on two topics."""
    with BagReader(BAG) as reader, BagWriter(folder, reader.custom_data) as writer:
        for topic in ('/wheel_states', '/radar'):
            writer.add_topic(topic, reader.topics[topic].type, reader.topics[topic].qos)
        for message in reader.messages(['/wheel_states', '/radar'], raw=True):
            if message.time - reader.start > 60_000_000:
                break
            writer.write(message.topic, message.time, message.message)
    return folder


def bare_mcaps(folder):
    """The same without what would find faults at once: checksums, compression, chunks, index."""
    with BagReader(folder) as reader:
        definition = reader.definition('/wheel_states')
        messages = list(reader.messages(['/wheel_states'], raw=True))
    for options in (
        {'compression': CompressionType.NONE, 'enable_crcs': False},
        {'compression': CompressionType.LZ4, 'enable_crcs': False},
        {'compression': CompressionType.ZSTD, 'enable_crcs': False, 'chunk_size': 500},
        {'use_chunking': False, 'enable_crcs': False},
        {
            'compression': CompressionType.NONE, 'enable_crcs': False, 'use_statistics': False,
            'use_summary_offsets': False, 'repeat_channels': False, 'repeat_schemas': False,
        },
    ):  # fmt: skip
        file = BytesIO()
        writer = McapWriter(file, **options)
        writer.start(profile='ros2', library='fuzz')
        schema = writer.register_schema(
            definition.type, definition.encoding, definition.text.encode()
        )
        channel = writer.register_channel('/wheel_states', 'cdr', schema)
        for message in messages:
            writer.add_message(channel, message.time, bytes(message.message), message.time)
        writer.finish()
        yield file.getvalue()


@pytest.fixture(scope='module')
def small(tmp_path_factory):
    return small_bag(tmp_path_factory.mktemp('fuzz') / 'small')


@pytest.fixture(scope='module')
def mcaps(small):
    return [(small / 'small.mcap').read_bytes(), *bare_mcaps(small)]


def read_all(path):
    with BagReader(path) as bag:
        assert isinstance(bag.duration, float)
        for topic in bag.topics:
            assert topic
        for k, _ in enumerate(bag.messages()):
            if k > 10_000:
                break


def test_mcap(tmp_path, mcaps):
    path = tmp_path / 'fuzz.mcap'

    def use(data):
        path.write_bytes(data)
        read_all(path)

    run('MCAP read', 25_000, lambda r: mutated(r, r.choice(mcaps)), use, BagError, tmp_path)


def test_repair(tmp_path, mcaps):
    path = tmp_path / 'fuzz.mcap'
    out = tmp_path / 'repaired'

    def use(data):
        path.write_bytes(data)
        try:
            repair_bag(path, out)
        finally:
            for each in out.glob('*') if out.is_dir() else ():
                each.unlink()
            if out.is_dir():
                out.rmdir()

    run('MCAP repair', 20_000, lambda r: mutated(r, r.choice(mcaps)), use, BagError, tmp_path)


def test_bag_metadata(tmp_path, small):
    text = (small / 'metadata.yaml').read_text()

    def use(data):
        (small / 'metadata.yaml').write_bytes(data)
        read_all(small)

    try:
        run('bag metadata', 3_000, lambda r: hostile_text(r, text), use, BagError, tmp_path)
    finally:
        (small / 'metadata.yaml').write_text(text)


def test_sqlite(tmp_path, small):
    folder = tmp_path / 'db'
    with (
        BagReader(small) as reader,
        RosbagsWriter(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer,
    ):
        connection = writer.add_connection(
            '/wheel_states', reader.topics['/wheel_states'].type, typestore=typestore()
        )
        for message in reader.messages(['/wheel_states'], raw=True):
            writer.write(connection, message.time, message.message)
    whole = next(folder.glob('*.db3')).read_bytes()
    with sqlite3.connect(next(folder.glob('*.db3'))) as database:
        assert database.execute('SELECT count(*) FROM messages').fetchone()[0] > 0
    path = tmp_path / 'fuzz.db3'

    def use(data):
        path.write_bytes(data)
        read_all(path)

    run('sqlite3 read', 7_000, lambda r: mutated(r, whole), use, BagError, tmp_path)


# YAML and CSV

SOILS = '\n'.join((PRESETS / 'soils.yaml').read_text().splitlines()[:14])
SWEEP = (
    ROOT / 'ros2_ws' / 'src' / 'traction_evaluation' / 'config' / 'sweep_tractor.yaml'
).read_text()
TERRAIN = (
    '- {soil: dry_sand}\n- {start: 8.0, soil: snow_us, grade: 0.02}\n- {start: 9, soil: lete_sand}'
)
GAINS = (
    Path(get_package_share_directory('traction_controller')) / 'config/gains/single_wheel_rig.yaml'
).read_text()
TABLE = 't,omega_fl,omega_fr,omega_rl,omega_rr,east,north,up\n' + ''.join(
    f'{0.1 * k:.1f},1.5,{k},2,3,0.1,{k},0\n' for k in range(20)
)


def load_sound_vehicle(path):
    vehicle = load_vehicle(path)
    assert np.all(np.isfinite(vehicle.static_loads()))


YAML = {
    'soil': (13_000, SOILS, lambda p: load_soil(f'{p}:dry_sand')),
    'vehicle': (
        10_000, (PRESETS / 'vehicles' / 'tractor_4wd.yaml').read_text(), load_sound_vehicle,
    ),
    'sweep': (4_000, SWEEP, read_sweep),
    'terrain': (3_000, TERRAIN, load_terrain),
    'gain table': (200, GAINS, read_gain_table),
    'import map': (4_800, find_map('import_t7165s').read_text(), CsvMap),
}  # fmt: skip


@pytest.mark.parametrize('name', YAML)
def test_yaml(tmp_path, name):
    count, text, load = YAML[name]
    path = tmp_path / 'fuzz.yaml'

    def use(data):
        path.write_bytes(data)
        load(path)

    # Without faults it is accepted.
    use(text.encode())
    documented = (DefinitionError, GainTableError, CsvImportError)
    run(f'{name} YAML', count, lambda r: hostile_text(r, text), use, documented, tmp_path)


CELLS = [
    '', 'nan', 'inf', '1e999', '-', '"', '""', '1_0', ' 1 ', '\x00', 'x' * 70000, '9' * 400,
    '1e-400', '0x1', '٣', ',', '\r', '\n', '1;2', '1e308', '-1e308', '1e99999999',
]  # fmt: skip


def hostile_table(r):
    if r.random() < 0.3:
        return mutated(r, TABLE.encode())
    rows = [line.split(',') for line in TABLE.splitlines()]
    for _ in range(r.choice([1, 1, 1, 2, 3])):
        row = r.choice(rows)
        if row:
            row[r.randrange(len(row))] = r.choice(CELLS)
    return '\n'.join(','.join(row) for row in rows).encode()


def test_csv(tmp_path):
    path, out = tmp_path / 'fuzz.csv', tmp_path / 'bag'
    known = find_map('import_rover')

    def use(data):
        path.write_bytes(data)
        try:
            import_csv(path, known, out)
            with BagReader(out) as bag:
                for message in bag.messages(['wheel_states']):
                    assert np.all(np.isfinite(message.message.velocity))
        finally:
            if out.is_dir():
                for each in out.iterdir():
                    each.unlink()
                out.rmdir()
        assert not list(tmp_path.glob('.bag*'))

    run('CSV import', 10_000, hostile_table, use, CsvImportError, tmp_path)


# Bombs: little that claims, or unpacks to, much


def peak(action):
    tracemalloc.start()
    try:
        documented = (BagError, BoundedYamlError, CsvImportError, DefinitionError)
        with pytest.raises(documented) as refused:
            action()
        return tracemalloc.get_traced_memory()[1], str(refused.value)
    finally:
        tracemalloc.stop()


def chunk_bomb(claimed, size):
    """An MCAP file with one chunk of zeros."""
    packed = zstandard.compress(bytes(MIB) * (size // MIB))
    body = struct.pack('<QQQI', 1, 2, claimed, 0) + struct.pack('<I4s', 4, b'zstd')
    body += struct.pack('<Q', len(packed)) + packed
    header = struct.pack('<I4sI', 4, b'ros2', 0)
    magic = b'\x89MCAP0\r\n'
    return (
        magic + b'\x01' + struct.pack('<Q', len(header)) + header
        + b'\x06' + struct.pack('<Q', len(body)) + body
        + b'\x02' + struct.pack('<QQQI', 20, 0, 0, 0) + magic
    )  # fmt: skip


@pytest.mark.parametrize('claimed', [1000, 2**31, 2**60])
@pytest.mark.parametrize('use', [read_all, repair_bag])
def test_a_chunk_unpacks_to_no_more_than_it_claims(tmp_path, claimed, use):
    path = tmp_path / 'bomb.mcap'
    path.write_bytes(chunk_bomb(claimed, 512 * MIB))
    assert path.stat().st_size < 100_000
    most, _ = peak(lambda: use(path))
    assert most < 16 * MIB


@pytest.mark.parametrize('size', [2**32 - 1, 2**40, 2**60, 2**63, 2**64 - 1])
@pytest.mark.parametrize('use', [read_all, repair_bag])
def test_a_record_that_claims_much_is_refused(tmp_path, mcaps, size, use):
    for whole in mcaps:
        data = bytearray(whole)
        data[9:17] = struct.pack('<Q', size)
        path = tmp_path / 'bomb.mcap'
        path.write_bytes(bytes(data))
        most, _ = peak(lambda path=path: use(path))
        assert most < 16 * MIB


BOMBS = {
    'aliases': 'a: &a [x, x, x, x, x, x, x, x, x]\n'
    + ''.join(
        f'{later}: &{later} [{", ".join(9 * [f"*{former}"])}]\n'
        for former, later in zip('abcdefgh', 'bcdefghi', strict=True)
    ),
    'itself': 'a: &a {b: *a}\n',
    'merge': f'a: &a {{{", ".join(f"k{k}: 1" for k in range(100))}}}\n'
    + ''.join(f'm{k}: {{<<: [{", ".join(50 * ["*a"])}]}}\n' for k in range(1_000)),
    'depth': '[' * 100_000,
    'block depth': ''.join(f'{" " * k}a:\n' for k in range(2_000)),
    'number': 'a: 0x' + 'f' * 100_000,
    'length': 'a: "' + 'x' * (17 * MIB) + '"',
}


@pytest.mark.parametrize('bomb', BOMBS)
@pytest.mark.parametrize(
    'use',
    [
        load_vehicle,
        read_sweep,
        read_gain_table,
        CsvMap,
        read_entries,
        lambda path: load_soil(f'{path}:a'),
    ],
)
def test_yaml_bombs_are_refused(tmp_path, bomb, use):
    path = tmp_path / 'bomb.yaml'
    path.write_text(BOMBS[bomb])
    started = time.perf_counter()
    most, said = peak(lambda: use(path))
    assert len(said) < 1000
    # The longest text, once as bytes and once decoded.
    assert most < 128 * MIB
    assert time.perf_counter() - started < LONGEST


# Messages

texts = st.text(max_size=4)
wheel_names = st.lists(st.sampled_from(['fl', 'fr', 'rl', 'rr', 'x', '']) | texts, max_size=6)
numbers = st.floats() | st.sampled_from([math.nan, math.inf, -math.inf, 1e308, -1e308, 0.0])
number_lists = st.lists(numbers, max_size=6)
EXAMPLES = settings(
    max_examples=max(50, round(20_000 * SHARE)),
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)


@EXAMPLES
@given(wheel_names, number_lists, st.booleans())
def test_joint_order_gives_finite_values_or_says_why(names, values, only):
    order = JointOrder(['fl', 'fr', 'rl'], 'torque', only)
    cause, found = '', []
    try:
        found = order.values(names, values)
    except JointError as error:
        cause = error.cause
    if cause:
        assert cause in ('names', 'length', 'not_finite')
        return
    assert len(found) == 3
    assert all(math.isfinite(value) for value in found)
    assert found == [values[names.index(name)] for name in ('fl', 'fr', 'rl')]


WHEELS = ['fl', 'fr']
LOW, HIGH, RATE = [-3000.0, -100.0], [8000.0, 50.0], [30000.0, 1000.0]


class Gate:
    """Gate with a check of its output after every call."""

    def __init__(self):
        self.gate = TorqueGate(WHEELS, LOW, HIGH, RATE, 0.1, 0.08)
        self.t = 0.0
        self.last_good = -math.inf

    def take(self, case):
        dt, stamp, names, efforts, measured = case
        self.t += dt
        gate = self.gate
        if measured:
            gate.measured(self.t, stamp, names, efforts)
        gate.step(self.t)
        self.check()
        before, running = list(gate.output), gate.state in (State.PASSING, State.HOLDING)
        accepted = gate.command(self.t, stamp, names, efforts)
        self.check()
        assert gate.reason
        if not accepted:
            assert gate.output == before
        elif running:
            for old, new, rate in zip(before, gate.output, RATE, strict=True):
                assert abs(new - old) <= rate * (self.t - self.last_good) + 1e-6
        if accepted:
            self.last_good = self.t

    def check(self):
        for torque, low, high in zip(self.gate.output, LOW, HIGH, strict=True):
            assert low <= torque <= high


SPECIAL = [math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 0.0, 8000.0, -3000.0]


def command(r):
    """A message as any node might send it, most with the right names."""
    names = WHEELS if r.random() < 0.8 else r.choices(['fl', 'fr', 'x', ''], k=r.randrange(4))
    efforts = [
        r.choice(SPECIAL) if r.random() < 0.1 else r.uniform(-1e4, 1e4)
        for _ in range(len(names) if r.random() < 0.9 else r.randrange(4))
    ]
    dt = r.choice([0.0, 1e-9, 0.001, 0.01, 0.05, 0.1, 0.15, 0.19, 1.0])
    stamp = r.choice([0.0, r.uniform(0, 10), r.uniform(0, 4e9)])
    return dt, stamp, names, efforts, r.random() < 0.3


def test_gate(tmp_path):
    gate = Gate()
    run('torque commands', 200_000, command, gate.take, (), tmp_path)
    assert gate.gate.limited['magnitude'] > 0
    assert sum(gate.gate.rejected.values()) > 0


@EXAMPLES
@given(st.lists(st.tuples(st.floats(0, 1), numbers, wheel_names, number_lists, st.booleans())))
def test_gate_with_any_messages(commands):
    gate = Gate()
    for dt, stamp, names, efforts, measured in commands:
        gate.take((dt, stamp, names, efforts, measured))
