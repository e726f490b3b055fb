"""The protocol as a page: messages, fields, values and rpcs with the comments of the proto files."""

from __future__ import annotations

import pathlib
import re
import subprocess
import tempfile

from google.protobuf import descriptor_pb2

FILES = ("stellate", "mesh", "oracle", "geometry", "errors", "doctor")
_TYPES = {
    number: name.removeprefix("TYPE_").lower()
    for name, number in descriptor_pb2.FieldDescriptorProto.Type.items()
}


def page(proto: pathlib.Path) -> str:
    """Markdown."""
    with tempfile.NamedTemporaryFile() as out:
        names = [f"stellate/v1/{name}.proto" for name in FILES]
        subprocess.run(
            ["protoc", f"-I{proto}", "--include_source_info", f"-o{out.name}", *names], check=True
        )
        described = descriptor_pb2.FileDescriptorSet.FromString(pathlib.Path(out.name).read_bytes())
    by_name = {file.name: file for file in described.file}
    parts = ["# The protocol\n", "The comments of the proto files, which are the specification.\n"]
    for name in names:
        parts += _file(by_name[name])
    return "\n".join(parts)


def _file(file: descriptor_pb2.FileDescriptorProto) -> list[str]:
    comments = {
        tuple(place.path): _words(place.leading_comments, place.trailing_comments)
        for place in file.source_code_info.location
    }
    parts = [f"## {file.name}\n"]
    if about := comments.get((2,)):
        parts.append(about + "\n")
    for i, service in enumerate(file.service):
        parts += [f"### service {service.name}\n", comments.get((6, i), "") + "\n"]
        for j, rpc in enumerate(service.method):
            takes, gives = (_short(kind) for kind in (rpc.input_type, rpc.output_type))
            takes = f"stream {takes}" if rpc.client_streaming else takes
            gives = f"stream {gives}" if rpc.server_streaming else gives
            parts += [f"#### {rpc.name}\n", f"`{takes}` → `{gives}`\n"]
            parts.append(comments.get((6, i, 2, j), "") + "\n")
    for i, enum in enumerate(file.enum_type):
        parts += _enum(enum, (5, i), comments)
    for i, message in enumerate(file.message_type):
        parts += _message(message, (4, i), comments, "")
    return parts


def _message(message, path, comments, outer) -> list[str]:
    name = outer + message.name
    parts = [f"### message {name}\n", comments.get(path, "") + "\n"]
    if message.field:
        parts += ["| Field | Number | Type | |", "|---|--:|---|---|"]
    for i, field in enumerate(message.field):
        kind = _short(field.type_name) if field.type_name else _TYPES[field.type]
        if field.label == field.LABEL_REPEATED:
            kind = f"repeated {kind}"
        elif field.proto3_optional:
            kind = f"optional {kind}"
        elif field.HasField("oneof_index"):
            kind = f"{kind}, one of `{message.oneof_decl[field.oneof_index].name}`"
        words = _cell(comments.get((*path, 2, i), ""))
        parts.append(f"| `{field.name}` | {field.number} | {kind} | {words} |")
    parts.append("")
    for i, enum in enumerate(message.enum_type):
        parts += _enum(enum, (*path, 4, i), comments)
    for i, nested in enumerate(message.nested_type):
        parts += _message(nested, (*path, 3, i), comments, f"{name}.")
    return parts


def _enum(enum, path, comments) -> list[str]:
    parts = [f"### enum {enum.name}\n", comments.get(path, "") + "\n"]
    parts += ["| Value | Number | |", "|---|--:|---|"]
    for i, value in enumerate(enum.value):
        words = _cell(comments.get((*path, 2, i), ""))
        parts.append(f"| `{value.name}` | {value.number} | {words} |")
    return [*parts, ""]


def _short(name: str) -> str:
    return name.removeprefix(".stellate.v1.").lstrip(".")


def _words(*comments: str) -> str:
    """Plain text as Markdown: nothing of it is markup, what is set in is shown as it stands."""
    text = "\n".join(re.sub(r"(?m)^ ", "", comment).strip("\n") for comment in comments if comment)
    paragraphs = []
    for paragraph in re.split(r"\n\s*\n", text):
        lines = paragraph.split("\n")
        set_in = [line.startswith("  ") for line in lines]
        if any(set_in):
            start = set_in.index(True)
            if start:
                paragraphs.append(_escaped("\n".join(lines[:start])))
            paragraphs.append("```text\n" + "\n".join(lines[start:]) + "\n```")
        else:
            paragraphs.append(_escaped(paragraph))
    return "\n\n".join(paragraphs)


def _escaped(text: str) -> str:
    return re.sub(r"([\\`*_<>\[\]#$|~])", r"\\\1", text)


def _cell(words: str) -> str:
    return re.sub(r"```text|```", "", words).replace("\n", " ").strip()
