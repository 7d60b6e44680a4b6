"""Typed TOML files: read into frozen msgspec structs with errors a person can act on, and written back.

Used for the robot's config and for scenes: both refuse unknown keys, wrong types and values out of range
in one line that names the file, the key's path and what is allowed.
"""

from __future__ import annotations

import difflib
import json
import re
import tomllib
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import inspect

from robot.errors import UserError

S = TypeVar("S", bound=msgspec.Struct)


def read(path: Path, kind: type[S]) -> S:
    """Read the TOML file into a struct of this kind. Raises `UserError` (one line: file, key, allowed)."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise UserError(
            f"{path}: no such file; `robot config show > {path}` writes one to start from"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: cannot be read ({error}); give a readable UTF-8 text file") from None
    return parse(text, kind, source=str(path))


def parse(text: str, kind: type[S], source: str) -> S:
    """Like `read` for text already in memory; `source` is named in errors."""
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        words = str(error)
        where = words[words.rfind("(at ") + 4 :].rstrip(")")
        raise UserError(f"{source}: not valid TOML at {where}: {words[: words.rfind(' (at ')]}") from None
    except (ValueError, RecursionError) as error:  # tomllib's own limits: digits, nesting
        raise UserError(f"{source}: not usable TOML: {error}; shorten it") from None
    try:
        return msgspec.convert(tree, kind, strict=True)
    except msgspec.ValidationError as error:
        raise UserError(f"{source}: {_explain(str(error), kind, tree)}") from None


def _explain(error: str, kind: type[Any], tree: dict[str, Any]) -> str:
    words, _, path = error.partition(" - at `$")
    keys = [key for key in re.split(r"[.\[\]`]+", path.rstrip("`")) if key]
    dotted = ".".join(keys)
    unknown = re.search(r"unknown field `(.*)`", words)
    if unknown:
        known = _known_keys(_walk(inspect.type_info(kind), keys))
        near = difflib.get_close_matches(unknown[1], known, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        full = ".".join([*keys, unknown[1]])
        return f"{full}: unknown key; {hint}allowed here: {', '.join(known)}"
    allowed = describe(_walk(inspect.type_info(kind), keys))
    if words.startswith("Object missing required field"):
        return f"{dotted or 'top level'}: {words[0].lower()}{words[1:]}; allowed: {allowed}"
    return f"{dotted or 'top level'} = {_toml(_value(tree, keys))} is not allowed; allowed: {allowed}"


def _value(tree: Any, keys: list[str]) -> Any:
    for key in keys:
        tree = tree[int(key)] if isinstance(tree, list) else tree[key]
    return tree


def _walk(info: inspect.Type | None, keys: list[str]) -> inspect.Type | None:
    for key in keys:
        info = _bare(info)
        if isinstance(info, inspect.StructType):
            info = next((f.type for f in info.fields if f.encode_name == key), None)
        elif isinstance(info, (inspect.ListType, inspect.VarTupleType)):
            info = info.item_type
        elif isinstance(info, inspect.DictType):
            info = info.value_type
        elif isinstance(info, inspect.TupleType) and key.isdigit():
            info = info.item_types[int(key)]
    return info


def _bare(info: inspect.Type | None) -> inspect.Type | None:
    while isinstance(info, inspect.Metadata):
        info = info.type
    return info


def _known_keys(info: inspect.Type | None) -> list[str]:
    bare = _bare(info)
    if isinstance(bare, inspect.StructType):
        return [f.encode_name for f in bare.fields]
    if isinstance(bare, inspect.UnionType):
        return sorted({key for member in bare.types for key in _known_keys(member)})
    return []


def describe(info: inspect.Type | None) -> str:
    """What a value of this type may be, in words: 'number from 0.05 to 0.5'."""
    bare = _bare(info)
    match bare:
        case inspect.FloatType() | inspect.IntType():
            name = "number" if isinstance(bare, inspect.FloatType) else "whole number"
            return name + _bounds(bare)
        case inspect.StrType(pattern=pattern) if pattern is not None:
            return _words_of_pattern(pattern.strip("^$"))
        case inspect.StrType():
            return "text"
        case inspect.BoolType():
            return "true or false"
        case inspect.EnumType(cls=cls):
            return "one of " + ", ".join(str(member.value) for member in cls)
        case inspect.LiteralType(values=values):
            return "one of " + ", ".join(str(value) for value in values)
        case inspect.ListType(item_type=item) | inspect.VarTupleType(item_type=item):
            return f"list of ({describe(item)})"
        case inspect.TupleType(item_types=items):
            return "list of " + ", ".join(describe(item) for item in items)
        case inspect.UnionType(types=types):
            return " or ".join(describe(member) for member in types)
        case inspect.StructType():
            return "a table with " + ", ".join(_known_keys(bare))
        case _:
            return "see the documentation"


def _words_of_pattern(pattern: str) -> str:
    """A pattern for people: the words to choose from, or the characters a text may have."""
    if pattern.startswith("("):
        return "one of " + pattern.strip("()").replace("|", ", ")
    characters = pattern.rstrip("*?").strip("[]")
    match pattern[-1]:
        case "*":
            return f"any of {characters}, or empty"
        case "?":
            return f"one of {characters}, or empty"
    return f"one of {', '.join(characters)}"


def _bounds(info: inspect.FloatType | inspect.IntType) -> str:
    low = info.ge if info.ge is not None else info.gt
    high = info.le if info.le is not None else info.lt
    words = ""
    if low is not None and high is not None:
        words = f" from {low:.7g} to {high:.7g}"
    elif low is not None:
        words = f" from {low:g}"
    elif high is not None:
        words = f" up to {high:g}"
    if info.multiple_of is not None:
        words += f", a multiple of {info.multiple_of:g}"
    return words


def commented(tree: msgspec.Struct) -> str:
    """The struct as TOML with every key's words and range as a comment; reads back as the same struct."""
    lines: list[str] = []
    _write_table(tree, [], lines)
    return "\n".join(lines).lstrip("\n") + "\n"


def _write_table(tree: msgspec.Struct, path: list[str], lines: list[str]) -> None:
    info = inspect.type_info(type(tree))
    assert isinstance(info, inspect.StructType)
    if path:
        lines += ["", f"# {(type(tree).__doc__ or '').splitlines()[0]}", f"[{'.'.join(path)}]"]
    nested: list[tuple[str, msgspec.Struct]] = []
    for entry in info.fields:
        value = getattr(tree, entry.name)
        if isinstance(value, msgspec.Struct):
            nested.append((entry.encode_name, value))
            continue
        words = _words(entry.type)
        comment = f"{words}; {describe(entry.type)}" if words else describe(entry.type)
        lines.append(f"{entry.encode_name} = {_toml(value)}  # {comment}")
    for key, value in nested:
        _write_table(value, [*path, key], lines)


def _words(info: inspect.Type) -> str:
    if isinstance(info, inspect.Metadata) and info.extra_json_schema:
        return str(info.extra_json_schema.get("description", ""))
    return ""


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)
