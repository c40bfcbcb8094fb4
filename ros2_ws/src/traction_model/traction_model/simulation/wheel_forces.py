"""Columns of the array of wheel forces in kernels, one row per wheel.

``LOAD`` load W on the wheel, N; ``THRUST`` F, N; ``RESISTANCE`` motion resistance R, N;
``MOMENT`` the soil's moment M about the centre, N·m; ``SINKAGE`` z, m; ``UPWARD`` the soil's
upward force N, N; ``SHEAR`` shear displacement of the soil at the exit, m.
"""

LOAD, THRUST, RESISTANCE, MOMENT, SINKAGE, UPWARD, SHEAR, FORCE_COLUMNS = range(8)
