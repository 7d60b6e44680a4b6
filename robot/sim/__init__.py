"""Simulated room, emulated devices and the referee. Importing the emulators needs no MuJoCo."""
