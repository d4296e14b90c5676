"""The faults that the equations of the dry clutch show, one file each."""
