"""The faults that the equations of the differential show, one file each."""
