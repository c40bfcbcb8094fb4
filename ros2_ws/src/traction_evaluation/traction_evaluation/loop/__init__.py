"""The loop of estimator, controller and gate, and the parameters that it ships with."""
