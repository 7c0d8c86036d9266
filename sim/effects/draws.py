"""Random numbers for blocks: a hash of a counter, so that a step is a function of its state. No effect itself."""

from __future__ import annotations

from sim.jit import compiled

_MASK = 0xFFFFFFFF


@compiled("float64(int64, int64)")
def uniform(counter: int, seed: int) -> float:
    """A number from 0 to 1, 0 and 1 excluded, for a counter and a seed from 0 on.

    The mixing steps are a 32-bit hash found by search (C. Wellons, hash-prospector).
    """
    x = (counter * 0x1E35A7BD + seed * 0x2C1B3C6D + 0x12345677) & _MASK
    for _ in range(2):
        x ^= x >> 16
        x = (x * 0x21F0AAAD) & _MASK
        x ^= x >> 15
        x = (x * 0x735A2D97) & _MASK
        x ^= x >> 15
    return (x + 0.5) / 4294967296.0
