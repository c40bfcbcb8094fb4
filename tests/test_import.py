"""Command for the import of CSV files, and replay of the bags."""

import math
from pathlib import Path

import numpy as np
import pytest

from traction_controller.estimation.slip_filter import SlipFilter
from traction_evaluation.drives.recording import read_recording
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle
from tractor_io.bags.csv_import import find_map, import_csv
from tractor_io.bags.reader import BagReader

FIELD = Path(__file__).resolve().parents[2] / 'shared' / 'data' / 'field'
needs_field_data = pytest.mark.skipif(
    not FIELD.is_dir(), reason=f'{FIELD} is not here: field data may not be copied'
)


def test_the_command_imports(tmp_path, traction):
    (tmp_path / 'log.csv').write_text(
        't,omega_fl,omega_fr,omega_rl,omega_rr,east,north,up\n0,1,1,1,1,0,0,0\n0.1,1,1,1,1,0,0,0\n'
    )
    bag = tmp_path / 'bag'
    arguments = ('bag', 'import-csv', tmp_path / 'log.csv', '--map', 'import_rover', '-o', bag)
    status, said = traction(*arguments)
    assert status == 0, said
    assert '4 messages on 2 topics from 2 rows over 0.100 s' in said
    _, info = traction('bag', 'info', bag)
    assert '/wheel_states' in info
    assert 'corenav-GP' in info
    status, said = traction(*arguments)
    assert status == 2
    assert 'traction: ' in said
    assert 'exists already' in said


@needs_field_data
def test_the_estimator_takes_the_tractor_of_the_field_data(tmp_path):
    bag = import_csv(
        FIELD / 'tractor_t7165s.csv', find_map('import_t7165s'), tmp_path / 'bag'
    ).path
    recording = read_recording(bag)
    assert recording.wheel_names == ('fl', 'fr', 'rl', 'rr')
    with BagReader(bag) as reader:
        vehicle = load_vehicle(reader.custom_data['vehicle'])
        estimation = SlipFilter(vehicle, load_soil(reader.custom_data['soil']))
        for each in reader.messages():
            t = (each.time - reader.start) * 1e-9
            if t > 300:
                break
            if each.topic == '/wheel_states':
                estimation.wheel_states(t, each.message.velocity, each.message.effort)
            else:
                twist = each.message.twist
                estimation.radar(t, twist.twist.linear.x, twist.covariance[0])
        assert math.isfinite(estimation.v)
        assert np.all(np.isfinite(estimation.slip))
