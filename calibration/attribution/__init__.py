"""Which effect explains the residual."""
