"""Writes the types of messages for the scripts of the page: `python -m plugins.page.tests.declarations`."""

import types
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired, Union, get_args, get_origin, get_type_hints

import weberlink_page
from weberlink_page import messages

PATH = Path(weberlink_page.__file__).parent / "page" / "js" / "messages.d.ts"
PLAIN = {str: "string", int: "number", float: "number", bool: "boolean", type(None): "null", Any: "any"}


def declarations() -> str:
    kinds = {name: kind for name, kind in vars(messages).items() if hasattr(kind, "__required_keys__")}
    lines = ["// Written by `python -m plugins.page.tests.declarations` from messages.py.", ""]
    for name, kind in kinds.items():
        if name.startswith("_") or kind.__module__ != messages.__name__:
            continue
        lines.append(f"export interface {name} {{")
        for member, hint in get_type_hints(kind, include_extras=True).items():
            lines.append(f"  {member}{'' if member in kind.__required_keys__ else '?'}: {typescript(hint)};")
        lines += ["}", ""]
    lines += [f"export type {name} = {typescript(getattr(messages, name))};" for name in ("Message", "Request")]
    return "\n".join(lines) + "\n"


def typescript(hint: Any) -> str:
    origin, arguments = get_origin(hint), get_args(hint)
    inner = [f'"{each}"' if origin is Literal else typescript(each) for each in arguments]
    if origin in (NotRequired, Annotated):
        return inner[0]
    if origin in (Literal, types.UnionType, Union):
        return " | ".join(inner)
    if origin is list:
        return f"({inner[0]})[]" if "|" in inner[0] else f"{inner[0]}[]"
    if origin is dict:
        record = f"Record<{', '.join(inner)}>"
        return f"Partial<{record}>" if "|" in inner[0] else record
    return f"[{', '.join(inner)}]" if origin is tuple else PLAIN.get(hint, getattr(hint, "__name__", "any"))


if __name__ == "__main__":
    PATH.write_text(declarations(), encoding="utf-8")
