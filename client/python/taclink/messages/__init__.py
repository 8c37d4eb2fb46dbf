"""Frozen dataclasses of what a server tells, and how they are made of the protocol's messages.

SI units throughout (m, N, Pa, s, rad); times are whole nanoseconds. Arrays are read-only. Vectors of a link
are in its frame: origin in the centre of the clamped end at the top camera's side, +z along the axis.
"""
