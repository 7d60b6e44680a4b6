"""interim"""
from __future__ import annotations
import math
import numpy as np
from robot.messages import FreeSpace
from calib.model import HeadMount, StereoRig
from robot.vision.stereo import Disparity


def free_space(disparity: Disparity, rig: StereoRig, mount: HeadMount, pan: float, tilt: float) -> FreeSpace:
    vs, us = np.nonzero(disparity.valid[::2, ::2]); vs*=2; us*=2
    d = disparity.values[vs, us] + rig.doffs
    keep = d > 4.0
    vs, us, d = vs[keep], us[keep], d[keep]
    z = rig.left.fx * rig.baseline / d
    cam = np.stack([(us - rig.left.cx) / rig.left.fx * z, (vs - rig.left.cy) / rig.left.fy * z, z])
    R, p = mount.left_eye(pan, tilt)
    pts = R @ cam + p[:, None]
    x, y, h = pts
    sigma = np.abs(z * disparity.sigma_px / d) * 0.6
    tol = np.maximum(0.03, 2 * sigma * 0.5)
    bearing = np.arctan2(y, x); rng = np.hypot(x, y)
    nb = 48; lo, hi = bearing.min() if len(bearing) else -.5, bearing.max() if len(bearing) else .5
    width = math.radians(1.5)
    b0 = math.floor(lo / width) * width
    nb = max(1, int((hi - b0) / width) + 1)
    edges = 0.15 * 1.06 ** np.arange(60); edges = edges[edges < 3.2]
    ib = ((bearing - b0) / width).astype(int).clip(0, nb - 1)
    ir = np.searchsorted(edges, rng) - 1
    ok = (ir >= 0) & (ir < len(edges) - 1)
    flat = ib * len(edges) + ir
    n = nb * len(edges)
    up = ok & (h > tol) & (h < 0.35); down = ok & (h < -tol - 0.01); ground = ok & (np.abs(h) <= tol)
    cu = np.bincount(flat[up], minlength=n).reshape(nb, -1); cd = np.bincount(flat[down], minlength=n).reshape(nb, -1)
    cg = np.bincount(flat[ground], minlength=n).reshape(nb, -1)
    occ = (cu + cd >= 4) & (cu + cd > 0.3 * cg)
    free = (cg >= 3) & ~occ
    bearings = b0 + (np.arange(nb) + .5) * width
    near = np.zeros(nb); far = np.zeros(nb); obs = []
    for i in range(nb):
        idx = np.nonzero(free[i])[0]
        if len(idx) == 0: 
            near[i]=far[i]=0; 
        else:
            s = idx[0]; o = np.nonzero(occ[i])[0]
            stop = o[0] if len(o) else len(edges) - 1
            j = s
            gap = 0
            last = s
            while j < stop:
                if free[i, j]: last = j; gap = 0
                else:
                    gap += 1
                    if gap > 2: break
                j += 1
            near[i] = edges[s]
            far[i] = edges[last + 1] if last >= s and s < stop else edges[s]
    sel = up | down
    sel[sel] = occ[ib[sel], ir[sel]]
    pp = np.stack([x[sel], y[sel]], 1)
    if len(pp) > 600: pp = pp[:: len(pp) // 600 + 1]
    return FreeSpace(bearings, near, far, pp.astype(float))
