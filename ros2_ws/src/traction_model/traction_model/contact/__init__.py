"""Contact of wheels with soil: forces, moments and tractive figures."""
