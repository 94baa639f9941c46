"""Array types of kernels' arguments: elements, dimensions and memory layout, stated in annotations.

`Array` is in C order without gaps, `Strided` may be any view; the element is the parameter, as in
`Array2D[np.float64]`. The second part of a type is Numba's notation; braces stand for the element's type.
"""

from __future__ import annotations

from typing import Annotated, TypeVar

import numpy as np
from numpy.typing import NDArray

Element = TypeVar("Element", bound=np.generic)

Array1D = Annotated[NDArray[Element], "{}[::1]"]
Array2D = Annotated[NDArray[Element], "{}[:, ::1]"]
Strided2D = Annotated[NDArray[Element], "{}[:, :]"]
