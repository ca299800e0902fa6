"""Relative paths of a configuration, made absolute from the place they are meant from."""

from collections.abc import Collection
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

M = TypeVar("M", bound=BaseModel)


def settle(model: M, folder: Path, overridden: Collection[str], where: tuple[str, ...] = ()) -> M:
    """A copy in which every path is absolute.

    Args:
        model: validated settings.
        folder: what a relative path in the file is relative to.
        overridden: fields set on the command line, whose paths are relative to the working directory.
        where: path of the model in the file.
    """
    settled: M = _settle(model, folder, overridden, where)
    return settled


def _settle(model: Any, folder: Path, overridden: Collection[str], where: tuple[str, ...]) -> Any:
    if isinstance(model, Path):
        base = Path.cwd() if ".".join(where) in overridden else folder
        return (base / model).resolve()
    if isinstance(model, tuple):
        return tuple(_settle(item, folder, overridden, (*where, str(i))) for i, item in enumerate(model))
    if isinstance(model, BaseModel):
        values = {name: getattr(model, name) for name in (*type(model).model_fields, *(model.model_extra or {}))}
        changed = {
            name: settled
            for name, value in values.items()
            if (settled := _settle(value, folder, overridden, (*where, name))) is not value
        }
        return model.model_copy(update=changed) if changed else model
    return model
