"""The console's pictures: each function draws one part of a view on a surface. No events, no time, no bus."""

import math

import pygame

from lira.hal.messages import Action, ExpertView, LaserScan
from lira.tools.console.canvas import Canvas
from lira.tools.console.palette import (
    AMBER,
    BACK,
    DIM,
    EDGE,
    GREEN,
    INK,
    PANEL,
    RED,
    SKY,
    TEXT,
    WHITE,
)
from lira.tools.console.picture import pixels_of
from lira.tools.operator.situation import CORNERS, Urgency
from lira.tools.operator.view import LOW_V, STALE_S, View, battery_share, beams_ahead
from lira.tools.operator.voice import Voice, progress_words, speak, verdict

SIZE = (1280, 680)  # fits a screen of 1366 by 768 with a desktop's bar and a window's frame
# How loud a situation is, by colour and the colour of the letters on it; without a sign the colour is a bar.
COLOURS: dict[Urgency, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    Urgency.IDLE: (DIM, TEXT),
    Urgency.CALM: (GREEN, TEXT),
    Urgency.WATCH: (AMBER, INK),
    Urgency.ASK: (SKY, INK),
    Urgency.NEED: (AMBER, INK),
    Urgency.ALARM: (RED, WHITE),
}
BANNER = pygame.Rect(560, 16, 704, 176)


def draw(surface: pygame.Surface, view: View) -> None:
    """The whole console, as large as fits on a surface."""
    canvas = Canvas.fitted(surface, SIZE)
    canvas.fill(BACK)
    draw_camera(canvas, pygame.Rect(16, 16, 528, 330), view)
    draw_scan(canvas, pygame.Rect(16, 358, 528, 260), view)
    draw_voice(canvas, BANNER, speak(view))
    draw_actions(canvas, pygame.Rect(560, 204, 704, 246), view)
    draw_counts(canvas, pygame.Rect(560, 460, 704, 94), view)
    draw_operator(canvas, pygame.Rect(560, 564, 704, 54), view)
    draw_status(canvas, pygame.Rect(16, 628, 1248, 40), view)


def draw_camera(canvas: Canvas, box: pygame.Rect, view: View) -> None:
    """The camera's picture, as large as fits; hatched out when it is stale."""
    panel(canvas, box, "camera")
    pixels = None if view.picture_age_s > STALE_S else pixels_of(view.picture)
    if pixels is None:
        canvas.write("no picture", box.center, 28, DIM, centre=True)
        return
    height, width = pixels.shape[:2]
    picture = pygame.image.frombuffer(pixels.tobytes(), (width, height), "RGB")
    canvas.picture(picture, (box.x + 8, box.y + 28, box.width - 16, box.height - 36))


def panel(canvas: Canvas, box: pygame.Rect, title: str) -> None:
    """A titled box."""
    canvas.rect(PANEL, box, radius=6)
    canvas.write(title, (box.x + 10, box.y + 8), 22, DIM)


def draw_scan(canvas: Canvas, box: pygame.Rect, view: View) -> None:
    """What the learner sees of the scan: a fan ahead of the robot, near is bright."""
    panel(canvas, box, f"lidar, {math.degrees(view.fov_rad):.0f} degrees ahead, {view.max_range_m:g} m")
    if view.scan is None or view.scan_age_s > STALE_S:
        canvas.write("no scan", box.center, 28, DIM, centre=True)
        return
    origin = (box.centerx, box.bottom - 18)
    reach_px = min(box.height - 50, (box.width / 2 - 12) / max(0.2, math.sin(min(view.fov_rad, math.pi) / 2)))
    points = fan(view.scan, view.fov_rad, view.max_range_m, origin, reach_px)
    if len(points) > 1:
        canvas.polygon((44, 62, 80), [origin, *(point for point, _ in points)])
        canvas.lines(EDGE, [point for point, _ in points])
    for point, share in points:
        if share < 1.0:
            canvas.circle(AMBER if share < 0.35 else SKY, point, 3)
    x, y = origin
    canvas.polygon(TEXT, [(x, y - 12), (x - 8, y + 8), (x + 8, y + 8)])


def fan(
    scan: LaserScan, fov_rad: float, max_range_m: float, origin: tuple[float, float], reach_px: float
) -> list[tuple[tuple[int, int], float]]:
    """Points on the screen for the beams ahead, left to right on the screen, each with its share of the range."""
    points = []
    for angle, distance_m in reversed(beams_ahead(scan, fov_rad, max_range_m)):
        share = distance_m / max_range_m
        x, y = origin[0] - math.sin(angle) * share * reach_px, origin[1] - math.cos(angle) * share * reach_px
        points.append(((round(x), round(y)), share))
    return points


def draw_voice(canvas: Canvas, box: pygame.Rect, voice: Voice) -> None:
    """Who drives, why, and what to do now. What needs a person fills the box and has a sign; the rest has a bar."""
    (colour, ink), corners = COLOURS[voice.urgency], CORNERS.get(voice.urgency, 0)
    canvas.rect(colour if corners else PANEL, box, radius=6)
    left = box.x + (112 if corners else 26)
    if corners:
        draw_sign(canvas, (box.x + 56, box.y + 62), corners, ink, colour)
    else:
        canvas.rect(colour, (box.x, box.y, 10, box.height), radius=4)
    canvas.write(voice.who, (left, box.y + 12), 48, ink)
    width = box.right - 16 - left
    y = canvas.write_lines(voice.why, (left, box.y + 56), 24, ink, width)
    canvas.write_lines(voice.now, (left, y + 10), 30, ink, width)


def draw_sign(
    canvas: Canvas, at: tuple[int, int], corners: int, ink: tuple[int, int, int], back: tuple[int, int, int]
) -> None:
    """A triangle to watch, a square to act, an octagon to stop."""
    x, y = at
    start = {3: -math.pi / 2, 4: math.pi / 4, 8: math.pi / 8}[corners]
    angles = [start + 2 * math.pi * k / corners for k in range(corners)]
    canvas.polygon(ink, [(x + 36 * math.cos(a), y + 36 * math.sin(a)) for a in angles])
    canvas.write("!", (x, y + 4), 44, back, centre=True)


def draw_actions(canvas: Canvas, box: pygame.Rect, view: View) -> None:
    """Every expert's action and activation beside its threshold, then the novice's, the human's and what drove."""
    panel(canvas, box, "actions: turn and speed, each of the robot's limits; activation beside its threshold")
    decision = view.deciding
    if decision is None:
        heard = view.linked or view.waiting
        idle = "paused" if view.paused else "nobody decides: start lira fusion" if heard else "no link"
        canvas.write(idle, box.center, 28, DIM, centre=True)
        return
    rows: list[tuple[str, Action, ExpertView | None]] = [(e.name, e.action, e) for e in decision.experts]
    rows.append(("novice", decision.novice, None))
    if decision.human is not None:
        rows.append(("human", decision.human, None))
    rows.append(("drives", decision.executed, None))
    step = min(58, (box.height - 40) // len(rows))
    for index, (name, action, expert) in enumerate(rows):
        y = box.y + 36 + index * step
        active = name == decision.driver or (expert is not None and expert.active)
        canvas.write(name, (box.x + 16, y + 6), 30, TEXT if active else DIM)
        draw_bar(canvas, pygame.Rect(box.x + 130, y + 4, 170, 22), -action[1], "turn")
        draw_bar(canvas, pygame.Rect(box.x + 320, y + 4, 170, 22), action[0], "speed")
        if expert is not None:
            draw_activation(canvas, pygame.Rect(box.x + 510, y + 4, 178, 22), expert, decision.threshold)


def draw_bar(canvas: Canvas, box: pygame.Rect, value: float, name: str) -> None:
    """A value in [-1, 1] from the middle."""
    canvas.rect(EDGE, box, 1)
    if math.isfinite(value):
        length = round(min(1.0, max(-1.0, value)) * (box.width / 2 - 2))
        left = min(box.centerx, box.centerx + length)
        canvas.rect(SKY, (left, box.y + 3, max(2, abs(length)), box.height - 6))
    canvas.lines(TEXT, [(box.centerx, box.y), (box.centerx, box.bottom)])
    canvas.write(name, (box.x, box.bottom + 2), 18, DIM)


def draw_activation(canvas: Canvas, box: pygame.Rect, expert: ExpertView, threshold: float) -> None:
    """Activation up to three thresholds; the line is the threshold, and a dot says active."""
    canvas.rect(EDGE, box, 1)
    full = max(3.0 * threshold, 1e-9)
    width = round(min(1.0, max(0.0, expert.activation / full)) * (box.width - 4))
    canvas.rect(AMBER if expert.active else EDGE, (box.x + 2, box.y + 3, width, box.height - 6))
    x = box.x + 2 + round((box.width - 4) / 3)
    canvas.lines(TEXT, [(x, box.y - 3), (x, box.bottom + 3)], 2)
    words = f"{expert.activation:.3f} of {threshold:.2f}" + (", active" if expert.active else "")
    canvas.write(words, (box.x, box.bottom + 2), 18, TEXT if expert.active else DIM)


def draw_counts(canvas: Canvas, box: pygame.Rect, view: View) -> None:
    """Labels, interventions, calls and training so far."""
    panel(canvas, box, "so far" if view.teaching is None else progress_words(view.teaching))
    if view.decision is None:
        return
    d, labels = view.decision, view.decision.labels
    pairs = (
        ("human labels", labels.stored_human),
        ("expert labels", labels.stored_expert),
        ("shown first", labels.demonstration),
        ("interventions", d.interventions),
        ("calls", d.calls),
        ("training steps", d.training_steps),
    )
    for index, (name, count) in enumerate(pairs):
        x = box.x + 16 + index * (box.width - 20) // len(pairs)
        canvas.write(str(count), (x, box.y + 30), 42, TEXT)
        canvas.write(name, (x, box.y + 70), 20, DIM)


def draw_operator(canvas: Canvas, box: pygame.Rect, view: View) -> None:
    """What became of the newest request, and which keys ask."""
    canvas.rect(PANEL, box, radius=6)
    words, accepted = verdict(view)
    colour = DIM if accepted is None else GREEN if accepted else RED
    canvas.rect(colour, (box.x, box.y, 10, box.height), radius=4)
    prefix = "" if accepted is None else "done: " if accepted else "no: "
    canvas.write(prefix + words, (box.x + 26, box.y + 8), 24, DIM if accepted is None else TEXT)
    names = () if view.decision is None else (expert.name for expert in view.decision.experts)
    keys = ["P " + ("go on" if view.paused else "pause"), "S save", "R held: new episode"]
    keys += ["V prove it", "U held: undo"] if view.teaching is not None else []
    keys += [f"{number} {name} drives" for number, name in enumerate(names, start=1)]
    canvas.write("    ".join(keys), (box.x + 26, box.y + 32), 20, DIM)


def draw_status(canvas: Canvas, box: pygame.Rect, view: View) -> None:
    """Link, speed, battery, emergency stop, keyboard."""
    canvas.rect(PANEL, box, radius=6)
    late = view.link_age_s > STALE_S
    lost = "waits in lockstep" if view.waiting else "link lost"
    link = lost if late else f"link {1e3 * view.link_age_s:.0f} ms"
    low = view.battery is not None and view.battery.voltage_v < LOW_V
    battery = "battery ?" if view.battery is None else f"battery {view.battery.voltage_v:.1f} V"
    battery += "" if view.battery is None else f" ({100 * battery_share(view.battery):.0f} %)"
    speed = (
        "" if view.odom is None or late else f"{view.odom.linear_m_s:+.2f} m/s  {view.odom.angular_rad_s:+.2f} rad/s"
    )
    keys = "no keyboard" if view.hand is None else f"keyboard {view.hand}: SPACE + arrows, Esc stops, F1 held releases"
    parts = (
        (view.robot, TEXT),
        (link, AMBER if late else TEXT),
        (battery + (" LOW" if low else ""), AMBER if low else TEXT),
        (speed, TEXT),
        (keys, DIM),
    )
    x: float = box.x + 14
    for words, colour in parts:
        x += canvas.write(words, (x, box.y + 11), 26, colour) + 30
