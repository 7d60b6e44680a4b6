"""A six-axis arm behind a controller that speaks Modbus."""
