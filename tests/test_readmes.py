"""READMEs explain every topic."""

from pathlib import Path

import pytest

from traction_node.topics import topics

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / 'ros2_ws' / 'src'
PACKAGES = (
    'torque_gate',
    'traction_model',
    'traction_controller',
    'tractor_io',
    'traction_bringup',
)


@pytest.mark.parametrize('name', topics())
def test_every_topic_is_explained_somewhere(name):
    texts = [path.read_text() for path in (ROOT / 'README.md', *SOURCES.glob('*/README.md'))]
    assert any(f'`{name}`' in text for text in texts)
