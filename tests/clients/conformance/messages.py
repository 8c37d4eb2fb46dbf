"""Messages with every field set, made by reflection: a field that is added to a .proto is in them."""

from __future__ import annotations

from itertools import count
from typing import Any, Iterator

from google.protobuf.descriptor import FieldDescriptor

EACH = 6  # elements of a list of numbers: whole vectors and whole covariances
NUMBERS = {
    FieldDescriptor.CPPTYPE_INT32,
    FieldDescriptor.CPPTYPE_INT64,
    FieldDescriptor.CPPTYPE_UINT32,
    FieldDescriptor.CPPTYPE_UINT64,
}
Leaf = tuple[str, Any]  # name of the field, value


def enum_name(field: FieldDescriptor, number: int) -> str:
    """In lower case, without the enum's prefix."""
    prefix = field.enum_type.values_by_number[0].name.removesuffix("UNSPECIFIED")
    return field.enum_type.values_by_number[number].name.removeprefix(prefix).lower()


def is_map(field: FieldDescriptor) -> bool:
    return field.message_type is not None and field.message_type.GetOptions().map_entry


def value_of(field: FieldDescriptor, numbers: Iterator[int]) -> Any:
    """A value that no other field has, but for truth values and enums, which have their last one."""
    if field.cpp_type == FieldDescriptor.CPPTYPE_BOOL:
        return True
    if field.cpp_type == FieldDescriptor.CPPTYPE_ENUM:
        return field.enum_type.values[-1].number
    if field.cpp_type == FieldDescriptor.CPPTYPE_STRING:
        text = f"text {next(numbers)}"
        return text.encode() if field.type == FieldDescriptor.TYPE_BYTES else text
    return next(numbers) if field.cpp_type in NUMBERS else next(numbers) + 0.5


def fill(message: Any, numbers: Iterator[int] | None = None, only: str = "") -> Any:
    """Sets all fields; of a oneof the last one, or the one that is called `only`."""
    numbers = numbers or count(1)
    for field in message.DESCRIPTOR.fields:
        oneof = field.containing_oneof
        if only and oneof is not None and len(oneof.fields) > 1 and field.name != only:
            continue
        if is_map(field):
            getattr(message, field.name)[f"key {next(numbers)}"] = value_of(
                field.message_type.fields_by_name["value"], numbers
            )
        elif field.message_type is not None:
            part = getattr(message, field.name)
            fill(part.add() if field.label == FieldDescriptor.LABEL_REPEATED else part, numbers)
        elif field.label == FieldDescriptor.LABEL_REPEATED:
            getattr(message, field.name).extend(value_of(field, numbers) for _ in range(EACH))
        else:
            setattr(message, field.name, value_of(field, numbers))
    return message


def leaves(message: Any) -> list[Leaf]:
    """What a client has to know. A vector's numbers bear the name of the field that holds the vector."""
    found: list[Leaf] = []
    for field, value in message.ListFields():
        if is_map(field):
            found += list(value.items())
            continue
        for one in value if field.label == FieldDescriptor.LABEL_REPEATED else [value]:
            if field.message_type is None:
                is_enum = field.cpp_type == FieldDescriptor.CPPTYPE_ENUM
                found.append((field.name, enum_name(field, one) if is_enum else one))
                continue
            is_vector = [part.name for part in field.message_type.fields] == ["x", "y", "z"]
            found += [(field.name if is_vector else name, leaf) for name, leaf in leaves(one)]
    return found
