"""What settings of a part are made of: pydantic models that refuse unknown keys, and numbers that are not finite."""

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import PydanticCustomError


class Options(BaseModel):
    """Settings of a driver, a robot, a shape or an emulator; frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _knows_the_keys(cls, data: Any) -> Any:
        if isinstance(data, Mapping):
            refuse_unknown_keys(cls, data)
        return data


def refuse_unknown_keys(model: type[BaseModel], data: Mapping[Any, Any]) -> None:
    """Raise ValidationError for the first key that a model forbids, with the nearest of those that it has, or all of
    them. `into` in its context is the one field that takes any keys, those of a driver."""
    fields = model.model_fields
    if model.model_config.get("extra") != "forbid" or any(info.validation_alias for info in fields.values()):
        return  # any key is good, or pydantic alone knows which
    for name in data:
        if name in fields:
            continue
        close = get_close_matches(str(name), fields, n=1, cutoff=0.5)
        hint = f"; did you mean {close[0]}?" if close else f"; known are {', '.join(sorted(fields))}" if fields else ""
        into = [
            field
            for field, info in fields.items()
            for each in (info.annotation, *get_args(info.annotation))
            if getattr(each, "model_config", {}).get("extra") == "allow"
        ]
        context = {"into": into[0]} if len(into) == 1 else {}
        problem = PydanticCustomError("unknown_key", f"unknown key{hint}", context)
        raise ValidationError.from_exception_data(
            model.__name__, [{"type": problem, "loc": (str(name),), "input": data[name]}]
        )
