"""Sections of reports: read, and replaced alone."""

import pytest

from traction_evaluation.closed_loop.report import evaluate_estimation
from traction_evaluation.markdown import replace_section, section

REPORT = '# Title\n\n## 1. First\n\nold\n\n### Part\n\nmore\n\n## 2. Second\n\nkept\n'


@pytest.fixture
def report(tmp_path):
    path = tmp_path / 'report.md'
    path.write_text(REPORT)
    return path


def test_a_section_is_replaced_and_no_other(report):
    replace_section(report, '## 1. First', 'new\n\nlines')
    assert report.read_text() == (
        '# Title\n\n## 1. First\n\nnew\n\nlines\n\n## 2. Second\n\nkept\n'
    )
    assert section(report, '## 1. First') == 'new\n\nlines'
    # The text that was there gives the file that was there; so does the last section.
    replace_section(report, '## 1. First', 'old\n\n### Part\n\nmore')
    replace_section(report, '## 2. Second', 'kept')
    assert report.read_text() == REPORT


def test_a_section_that_does_not_exist(report):
    with pytest.raises(ValueError, match=r"report\.md has no section '## 3\. Third'"):
        replace_section(report, '## 3. Third', 'text')
    assert report.read_text() == REPORT


@pytest.mark.parametrize('text', [None, REPORT, 'Digest of the shipped parameters: `0`\n'])
def test_estimation_alone_needs_a_report_of_the_shipped_parameters(tmp_path, text):
    if text is not None:
        (tmp_path / 'control.md').write_text(text)
    with pytest.raises(ValueError, match='not written with the shipped parameters'):
        evaluate_estimation(tmp_path, tmp_path)
