#!/usr/bin/python3
"""Writes the API's reference in Markdown, made from the comments of its .proto files.

    api_reference.py DESCRIPTORS PAGE      (the target api_reference calls it)
"""

import contextlib
import sys

from google.protobuf import descriptor_pb2

Field = descriptor_pb2.FieldDescriptorProto
SCALARS = {getattr(Field, name): name[5:].lower() for name in dir(Field) if name.startswith("TYPE_")}
HEAD = """# API reference

Package `taclink.v1`: gRPC, and gRPC-Web over HTTP. SI units throughout: m, N, Pa, s, rad. This page is made from the comments of `proto/taclink/v1`.
"""


class File:
    """A .proto file's parts with their comments."""

    def __init__(self, proto):
        self.proto = proto
        self.comments = {tuple(where.path): where.leading_comments for where in proto.source_code_info.location}

    def text(self, *path):
        return " ".join(line.strip() for line in self.comments.get(path, "").strip().splitlines())


def cell(text):
    return text.replace("|", "\\|")


def link(type_name):
    """Of '.taclink.v1.Name' or a nested name."""
    name = type_name.split("taclink.v1.")[-1].lstrip(".")
    return f"[{name}](#{name.lower().replace('.', '')})" if ".taclink.v1." in type_name else name


def type_of(field, message):
    if field.type == Field.TYPE_MESSAGE:
        nested = {f".taclink.v1.{message.name}.{inner.name}": inner for inner in message.nested_type}
        inner = nested.get(field.type_name)
        if inner is not None and inner.options.map_entry:
            key, value = inner.field
            return f"map of {SCALARS[key.type]} to {type_of(value, message)}"
    base = link(field.type_name) if field.type_name else SCALARS[field.type]
    if field.label == Field.LABEL_REPEATED:
        return "list of " + base
    return "optional " + base if field.proto3_optional else base


def print_services(file):
    for s, service in enumerate(file.proto.service):
        print(f"\n## {service.name}\n\n{file.text(6, s)}\n")
        print("| call | takes | gives | what |\n|---|---|---|---|")
        for m, method in enumerate(service.method):
            takes = ("stream of " if method.client_streaming else "") + link(method.input_type)
            gives = ("stream of " if method.server_streaming else "") + link(method.output_type)
            print(f"| `{method.name}` | {takes} | {gives} | {cell(file.text(6, s, 2, m))} |")


def print_message(file, message, path):
    print(f"\n### {message.name}\n\n{file.text(*path)}".rstrip())
    if message.field:
        print("\n| field | type | what |\n|---|---|---|")
    for f, field in enumerate(message.field):
        what = file.text(*path, 2, f)
        if field.HasField("oneof_index") and not field.proto3_optional:
            what = f"(one of `{message.oneof_decl[field.oneof_index].name}`) {what}"
        print(f"| `{field.name}` {field.number} | {type_of(field, message)} | {cell(what)} |")


def print_enum(file, enum, path):
    print(f"\n### {enum.name}\n\n{file.text(*path)}".rstrip())
    print("\n| value | what |\n|---|---|")
    for v, value in enumerate(enum.value):
        print(f"| `{value.name}` {value.number} | {cell(file.text(*path, 2, v))} |")


def main():
    files = descriptor_pb2.FileDescriptorSet()
    with open(sys.argv[1], "rb") as descriptors:
        files.ParseFromString(descriptors.read())
    ours = [File(proto) for proto in sorted(files.file, key=lambda f: f.name) if proto.package == "taclink.v1"]
    with open(sys.argv[2], "w", encoding="utf-8") as page, contextlib.redirect_stdout(page):
        print(HEAD.rstrip())
        for file in ours:
            print_services(file)
        for file in ours:
            print(f"\n## {file.proto.name}")
            for m, message in enumerate(file.proto.message_type):
                print_message(file, message, (4, m))
            for e, enum in enumerate(file.proto.enum_type):
                print_enum(file, enum, (5, e))


if __name__ == "__main__":
    main()
