"""``python -m daemon worker`` that compiles before each run, as it says, and always has news."""

import itertools
import sys
from collections import Counter

from daemon.__main__ import main
from daemon.batch.worker import _work
from daemon.batch.worker._zygotes import ZygotePool
from daemon.model.status import Preparation, PreparationPhase

LOOKS = 3
"""Looks at a run until its kernels are there."""


class HesitantPool(ZygotePool):
    """Makes each run wait for its kernels; what it prepares changes, so a renewal is always due."""

    def __init__(self, slots, executor):
        super().__init__(slots, executor)
        self._looks = Counter()
        self._steps = itertools.count()

    @property
    def preparation(self):
        return Preparation(PreparationPhase.COMPILING, next(self._steps))

    def prepare(self, spec, scene, limits):
        self._looks[spec.sut.name] += 1
        return self._looks[spec.sut.name] > LOOKS and super().prepare(spec, scene, limits)


if __name__ == "__main__":
    _work.ZygotePool = HesitantPool
    sys.exit(main())
