"""Laws: where an unknown term acts, and on which inputs it depends, where no effect of the catalogue explains."""
