"""Linear parameter-varying (LPV) models of traction."""
