"""The simulated world as a process of its own, in real time, behind ptys and loopback sockets.

    launch      starts the process; begin, claims, faults, truth, the referee's outcome
    process     the process itself: ticks, channels, referee        messages   what passes between
    paced_world the world beside the wall clock (pacer)             moments    which picture a claim means
    far_ends    all that drivers reach, together:
                eye_server + head_controls (as mjpg-streamer), darkroom (draws for them),
                brick_tap (before the brick on its pty), control_box (Modbus), typist (teleop pty),
                switches (cables that can be pulled)

No file here knows a driver: these are the other reading of each protocol.
"""
