"""Named tuples of arrays for compiled functions, passed as data pointers and shapes alone.

Numba passes an array as 5 + 2 n_dim numbers and a tuple as those of all its parts, and counts the
references to each. A function that takes hundreds of arrays so compiles for seconds. A `light`
named tuple passes an array without those that follow from the others, and its arrays are not
counted: they must live as long as the call that was given them.
"""

from collections.abc import Mapping
from functools import partial
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numba import typeof
from numba.core import cgutils, types
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import (
    NativeValue,
    intrinsic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.arrayobj import make_array, populate_array


class Light(types.Type):
    """The type of a light named tuple: that of the tuple `whole`."""

    def __init__(self, whole: types.NamedTuple):
        self.whole = whole
        super().__init__(f"Light({whole})")

    @property
    def key(self):
        """What distinguishes it."""
        return self.whole

    def parts(self):
        """Name and type of each part."""
        return zip(self.whole.fields, self.whole.types, strict=True)


def is_short(part: types.Type) -> bool:
    """Whether a part is an array that its data and shape describe."""
    return isinstance(part, types.Array) and part.layout == "C"


@register_model(Light)
class LightModel(models.StructModel):
    """Data and shape of each array, and all other parts as they are."""

    def __init__(self, manager, light):
        members: list[tuple[str, types.Type]] = []
        for name, part in light.parts():
            if is_short(part):
                members.append((f"{name}_data", types.CPointer(part.dtype)))
                members.append((f"{name}_shape", types.UniTuple(types.intp, part.ndim)))
            else:
                members.append((name, part))
        super().__init__(manager, light, members)


@infer_getattr
class LightAttributes(AttributeTemplate):
    """The parts of a light named tuple are its attributes."""

    key = Light

    def generic_resolve(self, light, name):  # type: ignore[override]
        """Type of an attribute; None if there is none."""
        return dict(light.parts()).get(name)


@lower_getattr_generic(Light)
def part_of(context, builder, light, value, name):
    """A part; of an array, one that owns no reference."""
    model = context.data_model_manager[light]
    part = dict(light.parts())[name]
    if not is_short(part):
        return impl_ret_borrowed(context, builder, part, model.get(builder, value, name))
    shape = cgutils.unpack_tuple(builder, model.get(builder, value, f"{name}_shape"))
    size = context.get_abi_sizeof(context.get_data_type(part.dtype))
    itemsize = context.get_constant(types.intp, size)
    strides = [itemsize]
    for length in shape[:0:-1]:
        strides.insert(0, builder.mul(length, strides[0], flags=("nsw",)))
    array = make_array(part)(context, builder)
    populate_array(
        array,
        data=model.get(builder, value, f"{name}_data"),
        shape=shape,
        strides=strides,
        itemsize=itemsize,
        meminfo=None,
    )
    return array._getvalue()


def fill(context, builder, light, values):
    """A light named tuple of the values of all parts."""
    short = cgutils.create_struct_proxy(light)(context, builder)
    for (name, part), value in zip(light.parts(), values, strict=True):
        if is_short(part):
            array = make_array(part)(context, builder, value)
            setattr(short, f"{name}_data", array.data)
            setattr(short, f"{name}_shape", array.shape)
        else:
            setattr(short, name, value)
    return short._getvalue()


@intrinsic
def lightened(typing, whole):
    """The light form of a named tuple within a compiled function."""

    def make(context, builder, signature, values):
        light = signature.return_type
        parts = cgutils.unpack_tuple(builder, values[0])
        return fill(context, builder, light, parts)

    return Light(whole)(whole), make


@unbox(Light)
def from_python(light, tuple_object, c):
    """Read a named tuple of Python, which keeps its arrays."""
    values = []
    is_error = cgutils.alloca_once_value(c.builder, cgutils.false_bit)
    for position, (_, part) in enumerate(light.parts()):
        native = c.unbox(part, c.pyapi.tuple_getitem(tuple_object, position))
        values.append(native.value)
        with c.builder.if_then(native.is_error, likely=False):
            c.builder.store(cgutils.true_bit, is_error)
    value = fill(c.context, c.builder, light, values)
    for (_, part), whole in zip(light.parts(), values, strict=True):
        if is_short(part):
            c.context.nrt.decref(c.builder, part, whole)
    return NativeValue(value, is_error=c.builder.load(is_error))


def light(named_tuple: type) -> type:
    """Let instances of a class of named tuples be light where compiled functions take them."""
    whole = typeof_impl.dispatch(tuple)

    @typeof_impl.register(named_tuple)
    def type_of(value, context):
        return Light(whole(value, context))

    return named_tuple


class Memory:
    """Tables of rows side by side in one array, and a light named tuple of other parts.

    A compiled function knows where each table begins and how long its rows are, so that its loops
    need not find out whether tables overlap. Tables and parts are attributes.

    Attributes
    ----------
    block
        All rows, (n_rows, row_length), zero at first.
    tables
        By name (n_rows, n_columns), or (n_columns,) where the number of rows is given as None.
    parts
        The named tuple.
    """

    def __init__(
        self,
        n_rows: Mapping[str, int | None],
        n_columns: int,
        row_length: int,
        parts: NamedTuple,
    ):
        last_rows = list(accumulate(1 if n is None else n for n in n_rows.values()))
        first_rows = [0, *last_rows[:-1]]
        self.block = np.zeros((last_rows[-1], row_length))
        self.tables: dict[str, np.ndarray] = {}
        for (name, n), first, last in zip(n_rows.items(), first_rows, last_rows, strict=True):
            rows = self.block[first:last, :n_columns]
            self.tables[name] = rows[0] if n is None else rows
        self.parts = parts
        places = zip(n_rows.items(), first_rows, strict=True)
        places_of_tables = tuple((name, first, n) for (name, n), first in places)
        self._numba_type_ = MemoryType(places_of_tables, row_length, typeof(parts))

    def __getattr__(self, name: str) -> Any:
        """A table or a part."""
        tables = self.__dict__["tables"]
        return tables[name] if name in tables else getattr(self.parts, name)


class MemoryType(types.Type):
    """The type of a `Memory`: name, first row and number of rows of each table, and the rest."""

    def __init__(
        self, places: tuple[tuple[str, int, int | None], ...], row_length: int, parts: Light
    ):
        self.places = places
        self.row_length = row_length
        self.parts = parts
        super().__init__(f"Memory({places}, {row_length}, {parts})")

    @property
    def key(self):
        """What distinguishes it."""
        return self.places, self.row_length, self.parts


@register_model(MemoryType)
class MemoryModel(models.StructModel):
    """The address of all rows, and the light named tuple."""

    def __init__(self, manager, memory):
        members = [("block", types.CPointer(types.float64)), ("parts", memory.parts)]
        super().__init__(manager, memory, members)


@infer_getattr
class MemoryAttributes(AttributeTemplate):
    """Tables and parts are attributes."""

    key = MemoryType

    def generic_resolve(self, memory, name):  # type: ignore[override]
        """Type of an attribute; None if there is none."""
        for table, _, n_rows in memory.places:
            if table == name:
                return types.Array(types.float64, 1 if n_rows is None else 2, "C")
        return dict(memory.parts.parts()).get(name)


@lower_getattr_generic(MemoryType)
def table_of(context, builder, memory, value, name):
    """A table that owns no reference, or a part of the named tuple."""
    model = context.data_model_manager[memory]
    for table, first_row, n_rows in memory.places:
        if table == name:
            block = model.get(builder, value, "block")
            return _rows(context, builder, memory, block, first_row, n_rows)
    return part_of(context, builder, memory.parts, model.get(builder, value, "parts"), name)


def _rows(context, builder, memory, block, first_row, n_rows):
    """An array of rows of a memory, with constant shape and strides."""
    n_columns = memory.row_length
    shape = (n_columns,) if n_rows is None else (n_rows, n_columns)
    itemsize = context.get_abi_sizeof(context.get_data_type(types.float64))
    strides = (itemsize,) if n_rows is None else (itemsize * n_columns, itemsize)
    number = partial(context.get_constant, types.intp)
    array = make_array(types.Array(types.float64, len(shape), "C"))(context, builder)
    populate_array(
        array,
        data=builder.gep(block, [number(first_row * n_columns)], inbounds=True),
        shape=[number(n) for n in shape],
        strides=[number(n) for n in strides],
        itemsize=number(itemsize),
        meminfo=None,
    )
    return array._getvalue()


@unbox(MemoryType)
def memory_from_python(memory, python_object, c):
    """Read a `Memory` of Python, which keeps its arrays."""
    value = cgutils.create_struct_proxy(memory)(c.context, c.builder)
    block = types.Array(types.float64, 2, "C")
    block_object = c.pyapi.object_getattr_string(python_object, "block")
    native_block = c.unbox(block, block_object)
    value.block = make_array(block)(c.context, c.builder, native_block.value).data
    c.context.nrt.decref(c.builder, block, native_block.value)
    parts_object = c.pyapi.object_getattr_string(python_object, "parts")
    native_parts = c.unbox(memory.parts, parts_object)
    value.parts = native_parts.value
    c.pyapi.decref(block_object)
    c.pyapi.decref(parts_object)
    is_error = c.builder.or_(native_block.is_error, native_parts.is_error)
    return NativeValue(value._getvalue(), is_error=is_error)
