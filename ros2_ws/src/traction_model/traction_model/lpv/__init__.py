"""Linear parameter-varying models of traction."""
