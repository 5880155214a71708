"""The equations of a swimming robot and how they are solved: residual, Newton's method, orbit, time steps."""
