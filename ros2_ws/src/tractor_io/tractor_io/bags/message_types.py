"""Message types of bags: those of ROS 2 Jazzy and of this suite, with their definitions."""

from functools import cache
from pathlib import Path
from typing import NamedTuple

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
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
