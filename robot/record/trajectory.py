"""trajectory.png: the room from above, the robot's way coloured by state, the target's way, detours.

Needs matplotlib (extra `plots`); it is imported only when a plot is made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from robot.errors import UserError
from robot.messages import Points
from robot.record import palette
from robot.record.scenery import Outline, Scenery, Stamped, place_at, stretches

__all__ = ["Outline", "Scenery", "plot_trajectory", "render"]

_INCHES_WIDE = 8.0
_DPI = 150
_DETOUR = "#ffd9a8"
_HALO = {"boxstyle": "round,pad=0.1", "facecolor": "#ffffffa0", "edgecolor": "none"}
_LABEL_SPACING_M = 0.25


def plot_trajectory(path: Path, scenery: Scenery, title: str = "") -> None:
    """Draw the scenery to a PNG; the same scenery gives the same bytes on one version of matplotlib.

    Raises UserError if matplotlib is missing, OSError if the file cannot be written.
    """
    png = render(scenery, title)
    path.write_bytes(png)


def render(scenery: Scenery, title: str = "") -> bytes:
    """The plot as the bytes of a PNG."""
    figure, axes = _figure(scenery)
    _draw_room(axes, scenery)
    _draw_obstacles(axes, scenery)
    _draw_target(axes, scenery)
    _draw_way(axes, scenery)
    _draw_ends(axes, scenery)
    _draw_frame(axes, scenery, title)
    buffer = BytesIO()
    # Without the version tag the bytes depend on the drawing alone.
    figure.savefig(buffer, format="png", dpi=_DPI, facecolor="white", metadata={"Software": None})
    return buffer.getvalue()


def check_plots() -> None:
    """Raise UserError if no plot can be drawn: before a run, not after it."""
    try:
        import_module("matplotlib")
    except ImportError as error:
        raise UserError("no plot without matplotlib: install it with `pip install robot[plots]`") from error


def _figure(scenery: Scenery) -> tuple[Any, Any]:
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise UserError("no plot without matplotlib: install it with `pip install robot[plots]`") from error
    low, high = _extent(scenery)
    aspect = (high[1] - low[1]) / (high[0] - low[0])
    figure = Figure(
        figsize=(_INCHES_WIDE, _INCHES_WIDE * min(max(aspect, 0.4), 1.6) + 0.6), layout="constrained"
    )
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    return figure, axes


def _extent(scenery: Scenery) -> tuple[Points, Points]:
    corners = np.array(scenery.room, dtype=np.float64).reshape(-1, 2)
    if len(corners) < 3:
        raise ValueError(f"a room needs at least 3 corners, got {len(corners)}")
    margin = 0.03 * float(np.ptp(corners, axis=0).max())
    return corners.min(axis=0) - margin, corners.max(axis=0) + margin


def _draw_room(axes: Any, scenery: Scenery) -> None:
    axes.set_facecolor("#e9ebef")
    xs, ys = zip(*scenery.room, scenery.room[0], strict=True)
    axes.fill(xs, ys, facecolor="#fbfaf7", zorder=0)
    axes.plot(xs, ys, color="#3c424d", linewidth=4, solid_joinstyle="miter", zorder=2)


def _draw_obstacles(axes: Any, scenery: Scenery) -> None:
    from matplotlib.patches import Polygon

    for body in scenery.obstacles:
        axes.add_patch(
            Polygon(
                body.points,
                closed=True,
                facecolor="#e7ddcf" if body.low else "#a99f93",
                edgecolor="#5d564d",
                hatch="////" if body.low else None,
                linewidth=1.0,
                zorder=2,
            )
        )
        centre = np.mean(np.array(body.points), axis=0)
        size = np.ptp(np.array(body.points), axis=0)
        if body.name and min(size) > 0.12:
            axes.annotate(
                body.name, centre, ha="center", va="center", fontsize=7, color="#2c2925", zorder=3, bbox=_HALO
            )


def _draw_target(axes: Any, scenery: Scenery) -> None:
    if not scenery.target_path:
        return
    places = np.array([(x, y) for _, x, y in scenery.target_path])
    colour = "#d99a00"
    axes.plot(
        places[:, 0],
        places[:, 1],
        color=colour,
        linewidth=1.6,
        linestyle=(0, (4, 2)),
        zorder=4,
        label="target",
    )
    axes.plot(
        *places[0], marker="*", markersize=11, markerfacecolor="white", markeredgecolor=colour, zorder=5
    )
    axes.plot(
        *places[-1], marker="*", markersize=15, markerfacecolor=colour, markeredgecolor="#6b4c00", zorder=7
    )


def _draw_way(axes: Any, scenery: Scenery) -> None:
    if scenery.path_odometry:
        odometry = np.array([(x, y) for _, x, y in scenery.path_odometry])
        axes.plot(
            odometry[:, 0],
            odometry[:, 1],
            color="#8d95a3",
            linewidth=1,
            linestyle=":",
            zorder=4,
            label="odometry",
        )
    if not scenery.path_true:
        return
    for number, (began, ended) in enumerate(scenery.detours):
        piece = _between(scenery.path_true, began, ended)
        axes.plot(piece[:, 0], piece[:, 1], color=_DETOUR, linewidth=13, solid_capstyle="round", zorder=1)
        if number == 0:
            axes.plot([], [], color=_DETOUR, linewidth=7, solid_capstyle="butt", label="detour")
    shown: set[str] = set()
    for stretch in stretches(scenery.path_true, scenery.state_changes):
        axes.plot(
            stretch.points[:, 0],
            stretch.points[:, 1],
            color=_hex(palette.state_colour(stretch.state)),
            linewidth=2.6,
            solid_capstyle="round",
            solid_joinstyle="round",
            zorder=6,
            label=None if stretch.state in shown else stretch.state,
        )
        shown.add(stretch.state)
    _draw_beginnings(axes, scenery)


def _draw_beginnings(axes: Any, scenery: Scenery) -> None:
    """A ring where each state began, with the time where there is room for it."""
    labelled: list[tuple[float, float]] = []
    for at, state in scenery.state_changes:
        if at > scenery.path_true[-1][0]:
            break
        x, y = place_at(scenery.path_true, at)
        colour = _hex(palette.state_colour(state))
        axes.plot(
            x,
            y,
            marker="o",
            markersize=6,
            markerfacecolor="white",
            markeredgecolor=colour,
            markeredgewidth=1.8,
            zorder=8,
        )
        if all(math.hypot(x - a, y - b) > _LABEL_SPACING_M for a, b in labelled):
            labelled.append((x, y))
            axes.annotate(
                f"{at:.1f} s",
                (x, y),
                xytext=(7, 6),
                textcoords="offset points",
                fontsize=7,
                color="#454b57",
                zorder=9,
            )


def _between(path: Sequence[Stamped], began: float, ended: float) -> Points:
    inside = [(x, y) for t, x, y in path if began < t < ended]
    return np.array([place_at(path, began), *inside, place_at(path, ended)])


def _draw_ends(axes: Any, scenery: Scenery) -> None:
    from matplotlib.patches import Circle

    if not scenery.path_true:
        return
    for word, (_, x, y) in (("start", scenery.path_true[0]), ("end", scenery.path_true[-1])):
        axes.add_patch(
            Circle(
                (x, y),
                scenery.robot_radius,
                facecolor="#ffffff80",
                edgecolor="#22272f",
                linewidth=1.2,
                zorder=5,
            )
        )
        axes.annotate(
            word,
            (x, y - scenery.robot_radius),
            xytext=(0, -9),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=8,
            fontweight="bold",
            color="#22272f",
            zorder=9,
            bbox=_HALO,
        )


def _draw_frame(axes: Any, scenery: Scenery, title: str) -> None:
    axes.set_xlabel("x in m")
    axes.set_ylabel("y in m")
    axes.tick_params(labelsize=8)
    axes.grid(True, color="#d8dbe1", linewidth=0.5, zorder=0.5)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_visible(False)
    if title:
        axes.set_title(title, fontsize=11, fontweight="bold", color="#22272f", loc="left")
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        axes.figure.legend(
            handles,
            labels,
            loc="outside lower center",
            ncols=min(len(handles), 9),
            frameon=False,
            fontsize=8,
            handlelength=1.6,
            columnspacing=1.4,
        )


def _hex(colour: palette.Rgb) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
