"""Named tuples of arrays for compiled functions, passed as data pointers and shapes alone.

Numba passes an array as 5 + 2 n_dim numbers and a tuple as those of all its parts, and counts the
references to each. A function that takes hundreds of arrays so compiles for seconds. A `light`
named tuple passes an array without those that follow from the others, and its arrays are not
counted: they must live as long as the call that was given them.
"""

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
