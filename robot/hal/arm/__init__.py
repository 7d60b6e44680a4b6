"""Robot arm controller over Modbus: the driver's place. `hal.interfaces.Arm` and its mock are there."""
