"""The figures of a session from the document that a launcher writes."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from weberlink.protocol.paths import LinkPath
from weberlink_figures.report import UNITS
from weberlink_figures.tree import Figures


def figures_of(document: Mapping[str, Any]) -> Figures:
    """The figures of a document of this release (`Figures.to_json`)."""
    channels = {name: document[name] for name in UNITS if name in document}
    figures: Figures = _of_json(Figures, {**document, "channels": channels})
    return figures


def _of_json(kind: Any, document: Any) -> Any:
    """A value of a type from its document."""
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is UnionType:  # with None
        return None if document is None else _of_json(arguments[0], document)
    if kind is LinkPath:
        return LinkPath(**document)
    if isinstance(kind, type) and is_dataclass(kind):
        types, values = get_type_hints(kind), {}
        for each in fields(kind):
            inner = document.get(each.name)
            if each.metadata and inner is None and (each.default is not None or "violation_floor" in document):
                inner = document  # where its own fields stand; those of Felt in one channel alone
            values[each.name] = _of_json(types[each.name], inner)
        return kind(**values)
    if origin is Mapping:
        return {name: _of_json(arguments[1], inner) for name, inner in document.items()}
    if isinstance(document, list):
        parts = (_of_json(arguments[0], inner) for inner in document)
        return tuple(parts) if origin is tuple else list(parts)
    return document
