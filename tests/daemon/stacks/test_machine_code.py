"""A kernel called by its machine code answers as the kernel does."""

import numpy as np

from daemon.stacks.kernels import interpolate_at, machine_code


def test_machine_code_answers_as_its_kernel_for_other_values_of_the_same_types():
    field = np.arange(12, dtype=np.float32).reshape(3, 4)
    direct = machine_code(interpolate_at, field, 0.0, 0.0, 0.5, 0.6, 0.7)
    for x, y in ((0.6, 0.7), (1.1, 0.9), (-1.0, 0.5)):
        asked = interpolate_at(2.0 * field, 0.0, 0.0, 0.5, x, y)
        assert direct(2.0 * field, 0.0, 0.0, 0.5, x, y) == asked
