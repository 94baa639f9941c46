"""Types of kernels' arguments and results: what a kernel is compiled for, stated in its annotations.

An array type gives dimensions and memory layout; its element is the parameter, as in `Array2D[np.float32]`.
`Array` is in C order without gaps, `Strided` may be any view, `ReadOnly` is in C order and may be read-only.
Scalars: `float` is float64, `int` is int64, a NumPy scalar is itself; `Float32` and `Int32` are given as
Python's and converted. The second part of a type is Numba's notation; braces stand for the element's type.
"""

from __future__ import annotations

from typing import Annotated, TypeVar

import numpy as np
from numpy.typing import NDArray

Element = TypeVar("Element", bound=np.generic)

Array1D = Annotated[NDArray[Element], "{}[::1]"]
Array2D = Annotated[NDArray[Element], "{}[:, ::1]"]
Array3D = Annotated[NDArray[Element], "{}[:, :, ::1]"]
Array4D = Annotated[NDArray[Element], "{}[:, :, :, ::1]"]
Array5D = Annotated[NDArray[Element], "{}[:, :, :, :, ::1]"]

Strided1D = Annotated[NDArray[Element], "{}[:]"]
Strided2D = Annotated[NDArray[Element], "{}[:, :]"]
Strided3D = Annotated[NDArray[Element], "{}[:, :, :]"]

ReadOnly1D = Annotated[NDArray[Element], "Array({}, 1, 'C', readonly=True)"]
ReadOnly2D = Annotated[NDArray[Element], "Array({}, 2, 'C', readonly=True)"]

Float32 = Annotated[float, "float32"]
Int32 = Annotated[int, "int32"]
