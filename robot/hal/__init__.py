"""Devices: what each kind is (interfaces), how it is reached (links) and its drivers."""
