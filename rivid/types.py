"""Array types and lengths of time that all modules share. On 64-bit platforms numpy.intp is int64."""

import datetime as dt

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]
Strings = NDArray[np.str_]

HOUR = 3600.0
"""Length of an hour [s]."""
DAY = 86_400.0
"""Length of a day [s]."""
ONE_DAY = dt.timedelta(days=1)
