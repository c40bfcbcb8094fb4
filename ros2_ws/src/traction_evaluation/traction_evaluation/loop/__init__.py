"""Loop of estimator, controller and gate, with its shipped parameters."""
