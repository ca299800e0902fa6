"""Signals through the codec as machine code: what `weberlink.studies.evaluate.replay` does, a hundred times as fast.

The predictors, the deadband and the arithmetic of both are the codec's own functions: `loop` says in which order a tick
calls them, without the objects of the live encoder and decoder that no compiler knows, and `compiler` lets numba
(extra: compiled) read both. The codec knows of neither. Every update, error and bound is that of the live encoder and
decoder, bit for bit.
"""
