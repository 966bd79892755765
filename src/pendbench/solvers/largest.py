"""The largest of many numbers."""

from __future__ import annotations

from pendbench.base.arrays import FloatArray
from pendbench.base.compiled import inlined


@inlined
def largest(values: FloatArray) -> float:
    """The largest of some numbers from 0 on, (n,), four at a time: none waits for the one before. nan counts as 0."""
    most0, most1, most2, most3 = 0.0, 0.0, 0.0, 0.0
    together = len(values) - len(values) % 4
    for i in range(0, together, 4):
        most0, most1 = max(most0, values[i]), max(most1, values[i + 1])
        most2, most3 = max(most2, values[i + 2]), max(most3, values[i + 3])
    for i in range(together, len(values)):
        most0 = max(most0, values[i])
    return max(most0, most1, most2, most3)
