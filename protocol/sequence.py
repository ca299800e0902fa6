"""Expansion of counters that travel truncated: sequence numbers, time stamps, ticks.

The full value is the one nearest to what the receiver expects; as in RFC 9000, appendix A.3, so it is right as long as
the expectation is off by less than half of what the truncated field can count.
"""

SEQUENCE_BITS = 24
SEQUENCE_MASK = (1 << SEQUENCE_BITS) - 1
ACKNOWLEDGEMENT_MASK = 0xFFFF


def expand(truncated: int, bits: int, near: int) -> int:
    """The number congruent to `truncated` modulo 2^bits that lies nearest to `near`; it may be negative."""
    half = 1 << (bits - 1)
    return near - half + ((truncated - near + half) & ((1 << bits) - 1))


def expand_counter(truncated: int, bits: int, near: int) -> int:
    """Like `expand`, for what only counts up from 0."""
    full = expand(truncated, bits, near)
    return full if full >= 0 else full + (1 << bits)
