"""The obstacle map: what the robot remembers of the floor around its start.

A square grid in the odometry frame holds three float32 numbers a cell: `evidence` for an obstacle, when the
cell was last hit by an obstacle point (`confirmed_at`) and when it was last seen free (`seen_free_at`). Looks
at the floor (`FreeSpace`) come in with `update`; the swept-corridor questions of guard and states go out with
`clearance` and `arc_clearance`. What they need to know of the body comes in with the call or the settings.

Source: [B] leaves the kept and updated map to the future (METHODS 4); ray clearing and decay are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot.messages import Clearance, FreeSpace, Points, Pose2, Twist
from robot.nav.fan import Fan
from robot.nav.sweep import arc_points, first_contact

NEVER = np.float32(-3e38)
"""`seen_free_at` and `confirmed_at` of a cell that never was: before any time, yet finite."""

Mask = NDArray[np.bool_]
Grid = NDArray[np.float32]
Window = tuple[slice, slice]


@dataclass(frozen=True, slots=True)
class MapSettings:
    """How the map is laid out and how fast it learns and forgets. Metres and seconds.

    Evidence is counted in "occupied from 1.0 up": one hit adds `hit`, one look that shows the cell free takes
    `miss`, and it never exceeds `most`. So two looks make an obstacle, and one that went away is gone after
    (most - 1) / miss looks, 0.7 s at 8 looks a second.
    """

    cell: float = 0.04
    side: float = 12.0
    body_radius: float = 0.13
    skirt: float = 0.06
    """Strip around the body that the eyes cannot see even looking down: never counted as unknown."""
    hit: float = 0.6
    miss: float = 0.35
    most: float = 3.0
    dense_points: int = 4
    """So many points in 3 x 3 cells nearer than `dense_within` are an obstacle at the first look."""
    dense_within: float = 0.8
    forget_after: float = 30.0
    """Occupied cells nobody confirmed for so long become unknown, or drift would seal passages."""


class ObstacleMap:
    """Obstacles, free floor and the unknown about the start, in the odometry frame.

    Arrays are indexed [row, column] = [y, x]; the middle of cell [i, j] lies at
    (origin + (j + 0.5) cell, origin + (i + 0.5) cell), origin = -side / 2. Outside the grid all is unknown.

    >>> floor = ObstacleMap()
    >>> floor.start_disc(Pose2(), 0.4)
    >>> floor.clearance(Pose2(), 0.0, 0.13, 3.0, now=0.0).limited_by
    'unknown'
    """

    def __init__(self, settings: MapSettings | None = None) -> None:
        self.settings = settings or MapSettings()
        if self.settings.cell <= 0 or self.settings.side < 4 * self.settings.cell:
            raise ValueError(f"the map needs cells and at least 4 of them a side, got {self.settings}")
        self.size = round(self.settings.side / self.settings.cell)
        self.origin = -0.5 * self.size * self.settings.cell
        self._evidence: Grid = np.zeros((self.size, self.size), np.float32)
        self._confirmed_at: Grid = np.full((self.size, self.size), NEVER, np.float32)
        self._seen_free_at: Grid = np.full((self.size, self.size), NEVER, np.float32)

    # ------------------------------------------------------------------------------------------ reading

    @property
    def evidence(self) -> Grid:
        """(n, n) float32 evidence for an obstacle, 0..most; occupied from 1.0. A read-only view, no copy."""
        return _read_only(self._evidence)

    @property
    def confirmed_at(self) -> Grid:
        """(n, n) float32 time of the last obstacle point in the cell, `NEVER` if none. Read-only view."""
        return _read_only(self._confirmed_at)

    @property
    def seen_free_at(self) -> Grid:
        """(n, n) float32 time the cell was last seen free, `NEVER` if not or if occupied. Read-only view."""
        return _read_only(self._seen_free_at)

    def occupied(self) -> Mask:
        """(n, n) bool, True where an obstacle stands (a new array)."""
        return self._evidence >= 1.0

    def seen_free(self, now: float = 0.0, memory_s: float = math.inf) -> Mask:
        """(n, n) bool, True where the floor was seen free within the last `memory_s` (a new array)."""
        return self._free_in((slice(None), slice(None)), now, memory_s)

    def centres(self, cells: NDArray[np.intp]) -> Points:
        """Middles (N, 2) in metres of cells given as (N, 2) rows and columns."""
        rc = np.asarray(cells, dtype=np.float64).reshape(-1, 2)
        return np.asarray(self.origin + (rc[:, ::-1] + 0.5) * self.settings.cell)

    def cells(self, points: Points) -> NDArray[np.intp]:
        """Rows and columns (N, 2) of points (N, 2) in metres; may lie outside the grid."""
        xy = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        return np.floor((xy[:, ::-1] - self.origin) / self.settings.cell).astype(np.intp)

    def occupied_points(self) -> Points:
        """Middles (N, 2) of the occupied cells, row by row: the input of `outlines.outlines`."""
        return self.centres(np.argwhere(self.occupied()))

    def occupied_about(self, points: Points, reach: float) -> Points:
        """Middles (M, 2) of the occupied cells within `reach` of the bounding box of points (N, 2)."""
        window, _, _ = self._around(np.asarray(points, dtype=np.float64), reach)
        return self._middles(window, self._evidence[window] >= 1.0)

    def disc_free(self, pose: Pose2, radius: float) -> bool:
        """True if no occupied cell's middle lies within `radius` of the pose: a round body may turn there."""
        window, x, y = self._around(np.array([[pose.x, pose.y]]), radius)
        inside = (x - pose.x) ** 2 + (y - pose.y) ** 2 <= radius * radius
        return not bool(np.any(inside & (self._evidence[window] >= 1.0)))

    # ----------------------------------------------------------------------------------------- learning

    def clear(self) -> None:
        """Forget everything: all is unknown again, as in a new map."""
        self._evidence[:] = 0.0
        self._confirmed_at[:] = NEVER
        self._seen_free_at[:] = NEVER

    def start_disc(self, pose: Pose2, radius: float, at: float = 0.0) -> None:
        """Mark the place where the robot was put as free: whoever put it there saw that floor."""
        window, x, y = self._around(np.array([[pose.x, pose.y]]), radius)
        inside = (x - pose.x) ** 2 + (y - pose.y) ** 2 <= radius * radius
        self._evidence[window][inside] = 0.0
        self._seen_free_at[window][inside] = at

    def update(self, free_space: FreeSpace, pose: Pose2, at: float) -> None:
        """Take in one look at the floor.

        Cells whose middle lies between `near` and `free` of their sector become free; obstacle points raise
        evidence; the floor the body stands on is free. Looks that hold NaN are cut to their finite part.

        Args:
            free_space: what was seen, robot frame at capture.
            pose: where the robot was at capture, odometry frame.
            at: capture time in seconds.
        """
        self._forget(at)
        hit = self._hits(free_space.obstacles, pose, at)
        self._clear_body(pose, at)
        self._clear_sectors(free_space, pose, at, hit)

    def _forget(self, at: float) -> None:
        stale = self._confirmed_at < at - self.settings.forget_after
        stale &= self._evidence > 0.0
        if stale.any():
            self._evidence[stale] = 0.0

    def _hits(self, obstacles: Points, pose: Pose2, at: float) -> Mask | None:
        """Raise evidence at the obstacle points; returns the (n, n) mask of cells hit, None without hits."""
        points = np.asarray(obstacles, dtype=np.float64).reshape(-1, 2)
        points = points[np.isfinite(points).all(axis=1)]
        world = pose.to_world(points)
        cells = self.cells(world)
        inside = ((cells >= 0) & (cells < self.size)).all(axis=1)
        if not inside.any():
            return None
        rows, columns = cells[inside, 0], cells[inside, 1]
        near = (np.hypot(points[inside, 0], points[inside, 1]) <= self.settings.dense_within).astype(np.uint8)
        window = (_span(rows, self.size), _span(columns, self.size))
        counts = np.zeros((window[0].stop - window[0].start, window[1].stop - window[1].start), np.float32)
        dense = counts.copy()
        np.add.at(counts, (rows - window[0].start, columns - window[1].start), 1.0)
        np.add.at(dense, (rows - window[0].start, columns - window[1].start), near)
        support = cv2.boxFilter(dense, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)

        here = counts > 0
        evidence, free = self._evidence[window], self._seen_free_at[window]
        evidence[here] = np.minimum(evidence[here] + self.settings.hit, self.settings.most)
        sure = here & (dense > 0) & (support >= self.settings.dense_points)
        evidence[sure] = np.maximum(evidence[sure], 1.0)
        self._confirmed_at[window][here] = at
        # An obstacle that is forgotten later must come back as unknown, not as the floor it once was.
        free[here & (evidence >= 1.0)] = NEVER
        hit = np.zeros((self.size, self.size), np.bool_)
        hit[window] = here
        return hit

    def _clear_body(self, pose: Pose2, at: float) -> None:
        self.start_disc(pose, self.settings.body_radius, at)

    def _clear_sectors(self, look: FreeSpace, pose: Pose2, at: float, hit: Mask | None) -> None:
        fan = Fan.of(look)
        if fan is None:
            return
        window, x, y = self._around(pose.to_world(fan.hull()), 0.0)
        free = fan.holds(x, y, pose)
        if hit is not None:
            free &= ~hit[window]
        evidence = self._evidence[window]
        evidence[free] = np.maximum(evidence[free] - self.settings.miss, 0.0)
        self._seen_free_at[window][free & (evidence < 1.0)] = at

    # ---------------------------------------------------------------------------------------- clearance

    def clearance(
        self,
        pose: Pose2,
        heading: float,
        half_width: float,
        max_range: float,
        now: float,
        memory_s: float = math.inf,
    ) -> Clearance:
        """How far a round body of radius `half_width` may go straight, front edge to first contact.

        Args:
            pose: of the body, odometry frame.
            heading: direction of travel in the robot frame, 0 ahead, pi backwards.
            half_width: radius of the swept circle in metres, the body's or a little more.
            max_range: metres; farther is not looked at.
            now: seconds.
            memory_s: floor seen free longer ago counts as unknown.

        Returns:
            distance in 0..max_range. limited_by 'obstacle' (also where the unknown strip just before an
            obstacle ends the way), 'unknown' or 'range'.
        """
        turned = Pose2(pose.x, pose.y, pose.yaw + heading)
        return self.arc_clearance(turned, Twist(1.0, 0.0), half_width, max_range, now, memory_s)

    def arc_clearance(
        self,
        pose: Pose2,
        twist: Twist,
        half_width: float,
        max_range: float,
        now: float,
        memory_s: float = math.inf,
    ) -> Clearance:
        """Like `clearance` along the arc that `twist` drives (backwards for v < 0), in metres of arc.

        A twist without forward speed sweeps nothing new: range. NaN: nothing is free.
        """
        numbers = (pose.x, pose.y, pose.yaw, twist.v, twist.w, half_width, max_range, now)
        if not all(map(math.isfinite, numbers)):
            return Clearance(0.0, "unknown")
        if twist.v == 0.0:
            return Clearance(max_range, "range")
        way = arc_points(pose, twist, max_range)
        window, x, y = self._around(way, half_width + self.settings.cell)
        occupied = self._evidence[window] >= 1.0
        if occupied.size == 0:
            return Clearance(0.0, "unknown")
        # The median closes single unseen cells between the rays and nothing wider.
        free = cv2.medianBlur(self._free_in(window, now, memory_s).astype(np.uint8), 3) > 0
        unknown = ~(free | occupied)
        # The eyes never see the strip against the body; the body itself stands there.
        blind = self.settings.body_radius + self.settings.skirt
        unknown &= (x - pose.x) ** 2 + (y - pose.y) ** 2 > blind * blind

        to_obstacle = self._contact(window, occupied, pose, twist, half_width)
        to_unknown = self._contact(window, unknown, pose, twist, half_width)
        if self._leaves(way, half_width):
            to_unknown = min(to_unknown, self._edge_distance(way, half_width, max_range))
        distance = min(to_obstacle, to_unknown, max_range)
        if distance >= max_range:
            return Clearance(max_range, "range")
        if to_obstacle <= distance + 3 * self.settings.cell:
            return Clearance(distance, "obstacle")
        return Clearance(distance, "unknown")

    def _contact(self, window: Window, mask: Mask, pose: Pose2, twist: Twist, half_width: float) -> float:
        points = self._middles(window, mask)
        return first_contact(pose.to_local(points), twist, half_width) if len(points) else math.inf

    def _leaves(self, way: Points, half_width: float) -> bool:
        return bool(np.abs(way).max() + half_width > -self.origin)

    def _edge_distance(self, way: Points, half_width: float, max_range: float) -> float:
        """Metres along the sampled way until the circle leaves the grid."""
        out = np.abs(way).max(axis=1) + half_width > -self.origin
        return max_range * float(np.argmax(out)) / (len(way) - 1)

    # ------------------------------------------------------------------------------------------- inside

    def _free_in(self, window: Window, now: float, memory_s: float) -> Mask:
        oldest = max(now - memory_s, -1e38)
        return (self._seen_free_at[window] >= np.float32(oldest)) & (self._evidence[window] < 1.0)

    def _middles(self, window: Window, mask: Mask) -> Points:
        return self.centres(np.argwhere(mask) + np.array([window[0].start, window[1].start]))

    def _around(self, points: Points, reach: float) -> tuple[Window, Grid, Grid]:
        """The window of cells within `reach` of the points' bounding box; x as (1, m), y as (k, 1)."""
        cell = self.settings.cell
        low = np.floor((points.min(axis=0) - reach - self.origin) / cell).clip(0, self.size)
        high = (np.floor((points.max(axis=0) + reach - self.origin) / cell) + 1).clip(0, self.size)
        j0, i0, j1, i1 = int(low[0]), int(low[1]), int(high[0]), int(high[1])
        x = (self.origin + (np.arange(j0, j1) + 0.5) * cell).astype(np.float32)[None, :]
        y = (self.origin + (np.arange(i0, i1) + 0.5) * cell).astype(np.float32)[:, None]
        return (slice(i0, i1), slice(j0, j1)), x, y


def _read_only(grid: Grid) -> Grid:
    view = grid.view()
    view.flags.writeable = False
    return view


def _span(index: NDArray[np.intp], size: int) -> slice:
    return slice(max(int(index.min()) - 1, 0), min(int(index.max()) + 2, size))
