"""Parameter files and READMEs agree with the nodes' tables: `make docs` writes them."""

from pathlib import Path

import pytest
import yaml

from traction_bringup.parameter_docs import FILES, behaviours, documents
from traction_node.parameter import resolve

SOURCES = Path(__file__).resolve().parents[1] / 'ros2_ws' / 'src'
DOCUMENTS = {str(path.relative_to(SOURCES)): text for path, text in documents(SOURCES)}


@pytest.mark.parametrize('name', DOCUMENTS)
def test_document_is_what_make_docs_would_write(name):
    assert (SOURCES / name).read_text(encoding='utf-8') == DOCUMENTS[name], 'run make docs'


@pytest.mark.parametrize('file', FILES, ids=[file.name for file in FILES])
def test_file_gives_the_defaults_but_for_what_is_named(file):
    # Read by YAML alone, not by the reader of the suite.
    content = yaml.safe_load((SOURCES / file.package / 'config' / file.name).read_text())
    assert list(content) == [f'/**/{node}' for node in file.values]
    for node, values in file.values.items():
        table = behaviours()[node][1].PARAMETERS
        given = resolve(table, content[f'/**/{node}']['ros__parameters'])
        defaults = resolve(table, {})
        differing = {name for name in given if given[name] != defaults[name]}
        assert differing == set(values), node
