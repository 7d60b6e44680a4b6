"""A person at the stick over one serial line: plain keys, binary frames and MAVLink on the same port."""
