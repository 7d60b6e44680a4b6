"""Image in, percept out. Pure functions and models: no files, no clock, no devices."""
