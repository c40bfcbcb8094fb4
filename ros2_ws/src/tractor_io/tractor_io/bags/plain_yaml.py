"""Writing of small YAML texts without aliases."""

from typing import Any

import yaml


class _PlainDumper(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:
        # rosbag2's reader takes repeated values, but no anchors.
        return True


def dump_plain_yaml(content: Any, inline_lists: bool = False) -> str:
    """Write a YAML text without aliases, keys in the order given.

    Parameters
    ----------
    content : object
        Of mappings, lists, texts, numbers.
    inline_lists : bool
        Lists and mappings that hold no others in one line.

    Returns
    -------
    str
        The text, without a line break at its end.
    """
    return yaml.dump(
        content, Dumper=_PlainDumper, default_flow_style=None if inline_lists else False,
        sort_keys=False, allow_unicode=True,
    ).strip()  # fmt: skip
