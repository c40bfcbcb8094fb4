"""Message types of bags: those of ROS 2 Jazzy and of this suite, with their definitions."""

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from tractor_io.bags.bag_error import BagError

INTERFACES = 'traction_interfaces'
"""Package of the suite's own messages."""


class MessageDefinition(NamedTuple):
    """Definition of a message type, as a bag keeps it.

    Attributes
    ----------
    type : str
        Message type, such as ``sensor_msgs/msg/JointState``.
    encoding : str
        ``ros2msg`` or ``ros2idl``.
    text : str
        Its definition, with the definitions of nested types.
    digest : str
        Hash of its description (RIHS01), empty where it is not known.
    """

    type: str
    encoding: str
    text: str
    digest: str


@cache
def typestore(interfaces: Path | None = None) -> Typestore:
    """Message types of ROS 2 Jazzy and of this suite.

    Parameters
    ----------
    interfaces : Path, optional
        Folder of traction_interfaces (with ``msg/*.msg``); by default its share folder as
        the ament index gives it.

    Returns
    -------
    Typestore
        Message classes (``.types``), serialization and deserialization.

    Raises
    ------
    BagError
        When the folder is not found.
    """
    if interfaces is None:
        try:
            interfaces = Path(get_package_share_directory(INTERFACES))
        except PackageNotFoundError:
            raise BagError(
                f'package {INTERFACES} is not in the ament index: build and source the workspace'
            ) from None
    store = get_typestore(Stores.ROS2_JAZZY)
    definitions = sorted((interfaces / 'msg').glob('*.msg'))
    if not definitions:
        raise BagError(f'{interfaces}: holds no msg/*.msg')
    for path in definitions:
        name = f'{INTERFACES}/msg/{path.stem}'
        store.register(get_types_from_msg(path.read_text(encoding='utf-8'), name))
    return store


def known_definition(
    message_type: str, interfaces: Path | None = None, what: str = 'topic'
) -> MessageDefinition:
    """Definition of a message type of ROS 2 Jazzy or of this suite.

    Parameters
    ----------
    message_type : str
        Such as ``sensor_msgs/msg/JointState``.
    interfaces : Path, optional
        Folder of traction_interfaces, as for `typestore`.
    what : str
        Name of the thing with this type, for the error.

    Returns
    -------
    MessageDefinition
        Definition of the type.

    Raises
    ------
    BagError
        If the type is not known.
    """
    store = typestore(interfaces)
    if message_type not in store.fielddefs:
        raise BagError(f'{what} has unknown type {message_type}')
    text, _ = store.generate_msgdef(message_type, ros_version=2)
    return MessageDefinition(message_type, 'ros2msg', text, store.hash_rihs01(message_type))


def zero_message(types: Typestore, message_type: str) -> Any:
    """Message with zeros and with empty texts and lists.

    Parameters
    ----------
    types : Typestore
        Message types.
    message_type : str
        One of these, such as ``sensor_msgs/msg/JointState``.

    Returns
    -------
    object
        Of the class of the type.
    """
    fields = types.fielddefs[message_type][1]
    return types.types[message_type](**{name: _zero(types, kind) for name, kind in fields})


def zero_list(types: Typestore, element: Any, length: int) -> Any:
    """Elements of a list in a message, each zero or empty.

    Parameters
    ----------
    types : Typestore
        Message types.
    element : tuple
        Kind of an element, as `rosbags` describes it.
    length : int
        Number of elements, at least 0.

    Returns
    -------
    ndarray, shape (length,), or list
        An array of numbers, in the unit of the field; a list of texts or messages.
    """
    node, detail = element
    if node is Nodetype.BASE and detail[0] != 'string':
        return np.zeros(length, _dtype(detail[0]))
    return [_zero(types, element) for _ in range(length)]


def _zero(types: Typestore, kind: Any) -> Any:
    node, detail = kind
    if node is Nodetype.NAME:
        return zero_message(types, detail)
    if node is Nodetype.BASE:
        return '' if detail[0] == 'string' else np.zeros((), _dtype(detail[0])).item()
    element, length = detail
    return zero_list(types, element, length if node is Nodetype.ARRAY else 0)


def _dtype(base: str) -> np.dtype[Any]:
    """Type of an array of a base type of ROS."""
    return np.dtype('uint8' if base in ('byte', 'char', 'octet') else base)
