"""The decorators of this package's kernels.

A product and a sum may become one operation (`contract`), which the kernels of `infoset` do not
allow: cut edges of an information set must be the same bit for bit whichever way round they are
computed. The sign of a zero is not kept (`nsz`). Nothing is assumed about NaN (no `nnan`): it
arises where numbers overflow or a matrix is singular, and kernels detect it by comparisons that
fail, such as `not value > 0.0`.
"""

from __future__ import annotations

from infoset.kernels import Kernels

_kernels = Kernels("contract", "nsz")
compiled = _kernels.compiled
allocation_free = _kernels.entry
inlined = _kernels.inlined
