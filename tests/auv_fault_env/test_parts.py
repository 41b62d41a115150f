import numpy as np

from auv_fault_env.compiling import kernel, part, scalar


@scalar
def square(x):
    return x * x


@part
def add_squares(values, factor, out):
    for k in range(len(values)):
        out[k] += factor * square(values[k])


@kernel
def three_sums(values, out):
    add_squares(values, 1.0, out)
    for _ in range(2):
        add_squares(values, values[0], out)


# no kernel, which could be read from the disk cache
@part
def outer(values, out):
    three_sums(values, out)
    return square(out[0]) + square(3) + square(len(values))


def test_a_function_has_one_copy_of_each_part_and_no_machine_code_of_its_own_for_it():
    values = np.array([2.0, 3.0])
    out = np.zeros(2)
    assert outer(values, out) == 20.0**2 + 9 + 4
    np.testing.assert_array_equal(out, [20.0, 45.0])
    # of numbers, whether written down or not, and of whole numbers
    assert len(square.part.overloads) == 2
    for one in (add_squares, three_sums):
        assert len(one.part.overloads) == 1
        assert not one.overloads
    assert len(outer.overloads) == 1 and not outer.part.overloads


def test_python_calls_a_part_too():
    assert square(1.5) == 2.25
    out = np.ones(1)
    add_squares(np.array([2.0]), 0.5, out)
    assert out[0] == 3.0
    three_sums(np.array([1.0]), out)
    assert out[0] == 6.0
