"""Columns of the array of wheel forces that the kernels fill, one row a wheel.

``LOAD`` load W on the wheel, N; ``THRUST`` F, N; ``RESISTANCE`` motion resistance R, N;
``MOMENT`` the soil's moment M about the centre, N·m; ``SINKAGE`` z, m; ``UPWARD`` the soil's
upward force N, N; ``SHEAR`` shear displacement of the soil as the wheel leaves it, m.
"""

LOAD, THRUST, RESISTANCE, MOMENT, SINKAGE, UPWARD, SHEAR, FORCE_COLUMNS = range(8)
