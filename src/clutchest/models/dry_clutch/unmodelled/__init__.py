"""Parts of a real clutch that the equations of [ME12] leave out."""
