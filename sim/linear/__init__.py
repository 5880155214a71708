"""Linear algebra of the solvers: small matrices, block systems, GMRES, trigonometric interpolation. No robots."""
