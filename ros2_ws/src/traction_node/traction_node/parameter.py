"""Table of the parameters of a node: name, type, range, unit, description."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from traction_node.closest import closest_name

Scalar = bool | int | float | str
Value = Scalar | tuple[str, ...] | tuple[float, ...]

TYPE_NAMES = {bool: 'a boolean', int: 'an integer', float: 'a number', str: 'a text'}


class ParameterError(ValueError):
    """Invalid parameter or combination of parameters; the text has the reason."""


@dataclass(frozen=True)
class NodeParameter:
    """Parameter of a node.

    Attributes
    ----------
    name : str
        Name as in YAML files and on the command line.
    default : bool, int, float, str, or list of str or float
        Value without an override; its type is the type of the parameter. A list has at least
        one entry.
    description : str
        Description, for `ros2 param describe`.
    unit : str
        Unit in SI notation such as 'N·m', empty for a number without one.
    minimum, maximum : float or None
        Inclusive range of the value, or of every entry of a list, in `unit`.
    choices : tuple
        The only values allowed; empty if every one is.
    read_only : bool
        True if the value cannot change while the node runs.
    """

    name: str
    default: Scalar | list[str] | list[float] | Value
    description: str
    unit: str = ''
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Scalar, ...] = ()
    read_only: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.default, list | tuple) and not self.default:
            raise ParameterError(f'parameter "{self.name}": an empty default has no type')
        object.__setattr__(self, 'default', self.check(self.default))

    @property
    def is_list(self) -> bool:
        """True if the value is a list."""
        return isinstance(self.default, list | tuple)

    @property
    def type(self) -> type:
        """Type of the value, or of each entry of a list."""
        return type(self.default[0] if isinstance(self.default, list | tuple) else self.default)

    @property
    def range_text(self) -> str:
        """Allowed values as text; empty if there is no limit."""
        unit = f' {self.unit}' if self.unit else ''
        if self.choices:
            return 'one of ' + ', '.join(str(choice) for choice in self.choices)
        if self.minimum is not None and self.maximum is not None:
            return f'{self.minimum:g} .. {self.maximum:g}{unit}'
        if self.minimum is not None:
            return f'at least {self.minimum:g}{unit}'
        if self.maximum is not None:
            return f'at most {self.maximum:g}{unit}'
        return ''

    def check(self, value: object) -> Value:
        """Checked and converted value.

        Parameters
        ----------
        value : object
            Value from a file, the command line or a service call.

        Returns
        -------
        bool, int, float, str or tuple
            An integer given for a number becomes a float, a list becomes a tuple.

        Raises
        ------
        ParameterError
            If type or value is not allowed; names parameter, value, range and unit.
        """
        if not self.is_list:
            return self._check_entry(value, value)
        if isinstance(value, str | bytes) or not isinstance(value, Iterable):
            raise self._wrong_type(value)
        entries = tuple(value)
        if not entries:
            raise ParameterError(f'parameter "{self.name}" needs at least one entry')
        return tuple(self._check_entry(entry, list(entries)) for entry in entries)  # type: ignore[return-value]

    def _check_entry(self, entry: object, value: object) -> Scalar:
        if self.type is float and isinstance(entry, int) and not isinstance(entry, bool):
            # Beyond the range of a double: not finite.
            entry = float(entry) if abs(entry) < 2**1023 else math.inf
        if type(entry) is not self.type:
            raise self._wrong_type(value)
        unit = f' {self.unit}' if self.unit else ''
        if isinstance(entry, float) and not math.isfinite(entry):
            raise ParameterError(f'parameter "{self.name}" = {value}{unit} is not finite')
        too_small = self.minimum is not None and entry < self.minimum  # type: ignore[operator]
        too_large = self.maximum is not None and entry > self.maximum  # type: ignore[operator]
        if too_small or too_large or (self.choices and entry not in self.choices):
            raise ParameterError(
                f'parameter "{self.name}" = {value}{unit} is out of range: {self.range_text}'
                if not self.choices
                else f'parameter "{self.name}" = {value!r} is not {self.range_text}'
            )
        return entry  # type: ignore[return-value]

    def _wrong_type(self, value: object) -> ParameterError:
        wanted = TYPE_NAMES[self.type]
        if self.is_list:
            wanted = 'a list, each entry ' + wanted
        unit = f' in {self.unit}' if self.unit else ''
        return ParameterError(f'parameter "{self.name}" = {value!r} should be {wanted}{unit}')


def unknown(name: str, known: Iterable[str]) -> ParameterError:
    """Error for a parameter that a node does not have.

    Parameters
    ----------
    name : str
        Unknown name.
    known : iterable of str
        Names of the parameters of the node.
    """
    near = closest_name(name, known)
    hint = f'; did you mean "{near}"?' if near else ''
    return ParameterError(f'there is no parameter "{name}"{hint}')


def resolve(
    parameters: Iterable[NodeParameter],
    overrides: Mapping[str, object],
    others: Iterable[str] = (),
) -> dict[str, Value]:
    """Values of all parameters of a table.

    Parameters
    ----------
    parameters : iterable of NodeParameter
        Table of parameters.
    overrides : mapping
        Values given by the user, by name.
    others : iterable of str
        Names that are declared elsewhere; they are ignored here.

    Returns
    -------
    dict
        Value of each parameter by name.

    Raises
    ------
    ParameterError
        If an override is not allowed, or names no parameter.
    """
    table = {parameter.name: parameter for parameter in parameters}
    others = set(others)
    for name in overrides:
        if name not in table and name not in others:
            raise unknown(name, [*table, *others])
    return {
        name: parameter.check(overrides.get(name, parameter.default))
        for name, parameter in table.items()
    }
