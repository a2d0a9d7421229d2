"""Numbers that a config may leave open: `"auto"` in their place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from pydantic import GetCoreSchemaHandler, ValidatorFunctionWrapHandler
from pydantic_core import CoreSchema, core_schema

Auto = Literal["auto"]
"""What a config leaves open: a budget, a plan or a target decides, and where none does the default."""


@dataclass(frozen=True)
class Between:
    """Annotation of a field: a whole number between two limits, or "auto".

    Pydantic's own union would report each mistake twice, once for the number and once for the word.

    Attributes
    ----------
    least, most : int
        The limits, inclusive.
    """

    least: int
    most: int

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema that pydantic checks the field by."""
        number = core_schema.int_schema(strict=True, ge=self.least, le=self.most)
        as_it_is = core_schema.plain_serializer_function_ser_schema(_as_it_is)
        return core_schema.no_info_wrap_validator_function(_number_or_auto, number, serialization=as_it_is)


def _as_it_is(value: int | Auto) -> int | Auto:
    return value


def _number_or_auto(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
    if isinstance(value, str) and value != "auto":
        raise ValueError('should be a whole number (an integer), or "auto"')
    return value if value == "auto" else handler(value)
