"""interim"""
from __future__ import annotations
import cv2, numpy as np
from robot.messages import Range
def range_box(left, right, box, rig, mount, pan, tilt):
    gl, gr = (cv2.cvtColor(i, cv2.COLOR_BGR2GRAY) for i in (left, right))
    H, W = gl.shape
    u, v = box.centre
    hw = int(max(5, min(20, box.w * .3))); hh = int(max(5, min(20, box.h * .2)))
    u0, v0 = int(u) - hw, int(v) - hh
    if u0 < 0 or v0 < 0 or u0 + 2 * hw >= W or v0 + 2 * hh >= H: return None
    t = gl[v0:v0 + 2 * hh, u0:u0 + 2 * hw]
    r0 = max(0, u0 - 64)
    s = gr[v0:v0 + 2 * hh, r0:u0 + 2 * hw]
    if s.shape[1] < t.shape[1] + 3: return None
    m = cv2.matchTemplate(s, t, cv2.TM_CCOEFF_NORMED)[0]
    k = int(m.argmax())
    if m[k] < .6 or k == 0 or k == len(m) - 1: return None
    a, b, c = m[k - 1:k + 2]
    k2 = k + .5 * (a - c) / (a - 2 * b + c)
    d = u0 - (r0 + k2) + rig.doffs
    if d <= 0.5: return None
    z = rig.left.fx * rig.baseline / d
    cam = np.array([(u - rig.left.cx) / rig.left.fx * z, (v - rig.left.cy) / rig.left.fy * z, z])
    R, p = mount.left_eye(pan, tilt)
    q = R @ cam + p
    return Range(float(z), float(z * .15 / d), (float(q[0]), float(q[1]), float(q[2])), float(d))
