"""Robot arm controller over Modbus. The driver follows; `hal.interfaces.Arm` and the mock are here already."""
