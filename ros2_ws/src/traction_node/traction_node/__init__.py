"""Base of all nodes: host, parameters, diagnostics, start and end; probes for tests."""
