"""The protocol's surface, a line for each thing that a client may rely on; held to the recorded one.

    tests/proto/surface.py             what was recorded is still there, as it was, and all is recorded
    tests/proto/surface.py --record    adds what is new to the record; removes nothing

proto/README.md says what may change. The record is proto/v1.txt.
"""

from __future__ import annotations

import argparse
import pathlib
import subprocess
import sys
import tempfile
from collections.abc import Iterator

from google.protobuf import descriptor_pb2

ROOT = pathlib.Path(__file__).resolve().parents[2]
RECORD = ROOT / "proto" / "v1.txt"
_Field = descriptor_pb2.FieldDescriptorProto


def surface(folder: pathlib.Path) -> list[str]:
    """Of the .proto files below `folder`, in the package stellate.v1, sorted."""
    files = sorted(folder.rglob("v1/*.proto"))
    with tempfile.TemporaryDirectory() as scratch:
        out = pathlib.Path(scratch) / "descriptors"
        subprocess.run(["protoc", f"-I{folder}", f"--descriptor_set_out={out}", *files], check=True)
        parsed = descriptor_pb2.FileDescriptorSet.FromString(out.read_bytes())
    lines: set[str] = set()
    for file in parsed.file:
        for message in file.message_type:
            lines.update(_message(message, f"{file.package}.{message.name}"))
        for enum in file.enum_type:
            lines.update(_enum(enum, f"{file.package}.{enum.name}"))
        for service in file.service:
            for call in service.method:
                takes = ("stream " if call.client_streaming else "") + call.input_type[1:]
                gives = ("stream " if call.server_streaming else "") + call.output_type[1:]
                name = f"{file.package}.{service.name}.{call.name}"
                lines.add(f"rpc {name} takes {takes} gives {gives}")
    return sorted(lines)


def _message(message: descriptor_pb2.DescriptorProto, name: str) -> Iterator[str]:
    yield f"message {name}"
    for field in message.field:
        kind = _Field.Type.Name(field.type)[len("TYPE_") :].lower()
        if field.type_name:
            kind += f" {field.type_name[1:]}"
        many = "repeated " if field.label == _Field.LABEL_REPEATED else ""
        if field.proto3_optional:
            many = "optional "
        elif field.HasField("oneof_index"):
            many = f"one of {message.oneof_decl[field.oneof_index].name}, "
        yield f"field {name} {field.number} {field.name}: {many}{kind}"
    for span in message.reserved_range:
        for number in range(span.start, span.end):
            yield f"reserved {name} {number}"
    for reserved in message.reserved_name:
        yield f"reserved {name} {reserved}"
    for nested in message.nested_type:
        yield from _message(nested, f"{name}.{nested.name}")
    for enum in message.enum_type:
        yield from _enum(enum, f"{name}.{enum.name}")


def _enum(enum: descriptor_pb2.EnumDescriptorProto, name: str) -> Iterator[str]:
    yield f"enum {name}"
    for value in enum.value:
        yield f"value {name} {value.number} {value.name}"


def differences(recorded: list[str], now: list[str]) -> list[str]:
    """What breaks clients, and what the record lacks, in words. Empty: neither."""
    found = [
        f"no longer as recorded, which breaks clients: {line}"
        for line in recorded
        if line not in now
    ]
    return found + [f"not recorded yet: {line}" for line in now if line not in recorded]


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--record", action="store_true", help="add what is new to proto/v1.txt")
    arguments = parser.parse_args()
    now = surface(ROOT / "proto")
    recorded = RECORD.read_text().splitlines() if RECORD.exists() else []
    if arguments.record:
        recorded = sorted({*recorded, *now})
        RECORD.write_text("\n".join(recorded) + "\n")
    found = differences(recorded, now)
    print("\n".join(found) or f"{len(now)} lines, all as recorded")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
