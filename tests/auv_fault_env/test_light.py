import gc
import sys
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from auv_fault_env.light import Light, Memory, light, lightened


@light
class Table(NamedTuple):
    values: np.ndarray
    cube: np.ndarray
    factor: float


class Pair(NamedTuple):
    values: np.ndarray
    table: Table


@njit
def element(table, i):
    return table.factor * table.values[i] + table.cube[i, 1, 0]


@njit
def total(table):
    sum = 0.0
    for i in range(len(table.values)):
        sum += element(table, i)
    table.cube[0, 0, 1] = sum
    return sum


@njit
def last_of(table):
    return element(lightened(Table(table.values[1:], table.cube[1:], table.factor)), 1)


@njit
def shapes(table):
    return table.values.shape, table.cube.shape, table.cube.strides, table.cube.size


@pytest.fixture
def table():
    cube = np.arange(18.0).reshape(3, 2, 3)
    return Table(np.array([1.0, 2.0, 3.0]), cube, 0.5)


def expected(table):
    return 0.5 * table.values.sum() + table.cube[:, 1, 0].sum()


def test_a_light_tuple_reads_and_writes_the_arrays_of_the_caller(table):
    right = expected(table)
    assert total(table) == right
    assert table.cube[0, 0, 1] == right
    (signature,) = total.signatures
    assert isinstance(signature[0], Light)


def test_a_light_tuple_can_be_made_of_views_within_a_compiled_function(table):
    assert last_of(table) == 0.5 * 3.0 + table.cube[2, 1, 0]


def test_arrays_have_their_shapes_and_strides(table):
    cube = table.cube
    assert shapes(table) == (table.values.shape, cube.shape, cube.strides, cube.size)


def test_an_array_whose_elements_are_apart_keeps_its_strides(table):
    apart = np.zeros((3, 2, 6))[:, :, ::2]
    apart[:] = table.cube
    assert total(table._replace(cube=apart)) == expected(table)


def test_a_call_keeps_no_reference(table):
    before = [sys.getrefcount(one) for one in table]
    for _ in range(10):
        total(table)
        last_of(table)
    gc.collect()
    assert [sys.getrefcount(one) for one in table] == before


def test_an_attribute_that_is_none_is_refused(table):
    @njit
    def wrong(table):
        return table.colour

    with pytest.raises(TypingError, match="colour"):
        wrong(table)


def test_other_parts_are_passed_as_they_are(table):
    @njit
    def nested(pair):
        return pair.values[0] + pair.table.values[1]

    assert nested(Pair(table.values, table)) == 3.0


@light
class Parts(NamedTuple):
    values: np.ndarray
    first: int


@njit
def fill_memory(memory):
    for c in range(5):
        memory.one[0, c] = 1.0
        memory.row[c] = 2.0
        memory.other[memory.first, c] = memory.values[0] + c
    memory.values[0] = memory.one.size
    return memory.one.shape, memory.row.shape


@pytest.fixture
def memory():
    return Memory({"one": 2, "row": None, "other": 3}, 5, 8, Parts(np.zeros(3), 2))


def test_a_memory_has_its_tables_and_parts_in_python_and_in_compiled_functions(memory):
    assert fill_memory(memory) == ((2, 8), (8,))
    np.testing.assert_array_equal(memory.one, [[1.0] * 5, [0.0] * 5])
    np.testing.assert_array_equal(memory.row, [2.0] * 5)
    np.testing.assert_array_equal(memory.other[2], np.arange(5.0))
    assert memory.values[0] == 16.0
    assert not memory.block[:, 5:].any()


def test_a_call_keeps_no_reference_to_a_memory(memory):
    kept = memory.block, memory.parts, memory.parts.values
    before = [sys.getrefcount(one) for one in kept]
    for _ in range(10):
        fill_memory(memory)
    gc.collect()
    assert [sys.getrefcount(one) for one in kept] == before


def test_what_a_memory_has_not_is_refused(memory):
    @njit
    def wrong(memory):
        return memory.colour

    with pytest.raises(TypingError, match="colour"):
        wrong(memory)
    with pytest.raises(AttributeError, match="colour"):
        memory.colour  # noqa: B018
