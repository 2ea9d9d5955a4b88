"""Names for the array types that the whole house uses."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
GreyArray = NDArray[np.uint8]
