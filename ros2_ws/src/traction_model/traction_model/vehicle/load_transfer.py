"""Longitudinal load transfer: the load on each wheel from the moments about the rear axle.

The vehicle is a rigid body; `Vehicle.load_distribution` divides its load. With the wheel loads W_j
and the positions x_j of the wheels ahead of the rear axle,

    sum_j W_j     = m*g*cos(grade)
    sum_j W_j*x_j = x_cg*m*g*cos(grade) - h_hitch*P - h_cg*(m*v' + m*g*sin(grade) + drag)
                    - sum_j (T_j - r_j*(F_j - R_j))
"""

from traction_model.kernel import inlined


@inlined
def load_moment(weight, cg_x, cg_height, hitch_height, pull, force_at_cg, wheel_moment):
    """Moment of all wheel loads about the ground contact of the rear axle.

    Parameters
    ----------
    weight : float
        Weight normal to the ground, N.
    cg_x, cg_height, hitch_height : float
        Centre of gravity ahead of the rear axle and above ground, and height of the hitch, m.
    pull : float
        Drawbar pull, N, backward positive.
    force_at_cg : float
        Backward force at the centre of gravity, N: inertia, grade and air drag.
    wheel_moment : float
        Sum over the wheels of shaft torque less radius times net traction, N·m: nose-up.

    Returns
    -------
    float
        N·m, positive for loads ahead of the rear axle.
    """
    return cg_x * weight - hitch_height * pull - wheel_moment - cg_height * force_at_cg


@inlined
def wheel_load(distribution, weight, moment):
    """Load on one wheel.

    Parameters
    ----------
    distribution : ndarray, shape (2,)
        The wheel's row of `Vehicle.load_distribution`, dimensionless and 1/m.
    weight : float
        Sum of the wheel loads, N.
    moment : float
        Its moment about the rear axle, see `load_moment`, N·m.

    Returns
    -------
    float
        N; negative if the moment lifts the wheel.
    """
    return distribution[0] * weight + distribution[1] * moment
