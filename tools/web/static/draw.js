// Draws one frame. No socket, no hands.

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

function begin(canvas) {
  const scale = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * scale)) canvas.width = Math.round(width * scale);
  if (canvas.height !== Math.round(height * scale)) canvas.height = Math.round(height * scale);
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}

function path(pen, points, close) {
  pen.beginPath();
  points.forEach(([x, y], index) => (index ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  if (close) pen.closePath();
}

// The scan as a fan ahead of the robot; what is near is bright.
export function drawFan(canvas, scan, { fov_rad: fov, max_range_m: most }) {
  const { pen, width, height } = begin(canvas);
  const [x, y] = [width / 2, height - 14];
  const reach = Math.max(10, Math.min(height - 24, (width / 2 - 8) / Math.max(0.2, Math.sin(Math.min(fov, Math.PI) / 2))));
  const points = scan.map(([angle, far]) => [x - (Math.sin(angle) * far * reach) / most, y - (Math.cos(angle) * far * reach) / most, far / most]);
  path(pen, [[x, y], ...points], true);
  pen.fillStyle = colour("rule");
  pen.globalAlpha = 0.5;
  pen.fill();
  pen.globalAlpha = 1;
  for (const [px, py, share] of points) {
    if (share >= 1) continue;
    pen.fillStyle = colour(share < 0.35 ? "watch" : "bar");
    pen.beginPath();
    pen.arc(px, py, 3, 0, 2 * Math.PI);
    pen.fill();
  }
  robot(pen, x, y, Math.PI / 2, 12);
}

function robot(pen, x, y, yaw, size) {
  pen.save();
  pen.translate(x, y);
  pen.rotate(-yaw);
  path(pen, [[size, 0], [-0.7 * size, 0.6 * size], [-0.7 * size, -0.6 * size]], true);
  pen.fillStyle = colour("ink");
  pen.fill();
  pen.restore();
}

// The way that was driven; a robot that is put back begins anew.
export class Trail {
  constructor() { this.points = []; }

  add([x, y]) {
    const last = this.points.at(-1);
    const far = last ? Math.hypot(x - last[0], y - last[1]) : 1;
    if (far > 1.5) this.points = [];
    if (far > 0.03 || !last) this.points.push([x, y]);
    if (this.points.length > 4000) this.points = this.points.filter((_, index) => index % 2);
    return this.points;
  }
}

// The floor of a twin, or nothing but the way driven, north up, scaled to fit.
export function drawMap(canvas, pose, trail, floor) {
  const { pen, width, height } = begin(canvas);
  const seen = [...floor.line, ...floor.way, ...floor.boxes.flat(), ...trail, pose];
  const [xs, ys] = [seen.map((point) => point[0]), seen.map((point) => point[1])];
  const [left, right, low, high] = [Math.min(...xs) - 1, Math.max(...xs) + 1, Math.min(...ys) - 1, Math.max(...ys) + 1];
  const scale = Math.min(width / (right - left), height / (high - low));
  const [dx, dy] = [(width - scale * (right - left)) / 2, (height - scale * (high - low)) / 2];
  const to = ([x, y]) => [dx + (x - left) * scale, height - dy - (y - low) * scale];
  const line = (points, style, thick) => {
    path(pen, points.map(to), false);
    Object.assign(pen, { strokeStyle: style, lineWidth: thick, lineJoin: "round" });
    pen.stroke();
  };
  const shapes = (outlines, style) => {
    pen.fillStyle = style;
    for (const outline of outlines) {
      path(pen, outline.map(to), true);
      pen.fill();
    }
  };
  shapes(floor.marks, colour("rule"));
  if (floor.line.length) line(floor.line, colour("way"), Math.max(2, floor.line_width_m * scale));
  if (floor.way.length) line(floor.way, colour("rule"), 1);
  shapes(floor.boxes, colour("box"));
  pen.globalAlpha = 0.5;
  shapes(floor.hanging, colour("box"));
  pen.globalAlpha = 1;
  line(trail, colour("bar"), 2);
  robot(pen, ...to(pose), pose[2], 9);
}

// Every expert's, the novice's and the person's action: turn and speed from the middle, activation up to three thresholds.
export function showActions(body, frame, words) {
  while (body.rows.length > frame.actors.length) body.deleteRow(-1);
  frame.actors.forEach((actor, index) => {
    const row = body.rows[index] || newRow(body);
    row.className = actor.name === frame.driver || actor.active ? "active" : "";
    row.cells[0].textContent = words[actor.name] || actor.name;
    setBar(row.cells[1].firstChild, -actor.action[1], `${words.turn} ${actor.action[1].toFixed(2)}`);
    setBar(row.cells[2].firstChild, actor.action[0], `${words.speed} ${actor.action[0].toFixed(2)}`);
    const act = row.cells[3].firstChild;
    act.style.visibility = actor.activation === null ? "hidden" : "visible";
    if (actor.activation !== null) {
      act.className = `bar act${actor.active ? " on" : ""}`;
      act.firstChild.style.width = `${Math.min(100, (100 * actor.activation) / (3 * frame.threshold || 1))}%`;
      act.title = `${words.activation}: ${actor.activation.toFixed(3)}, ${frame.threshold.toFixed(2)}`;
    }
  });
}

function newRow(body) {
  const row = body.insertRow();
  row.append(document.createElement("th"));
  for (let k = 0; k < 3; k += 1) {
    const bar = document.createElement("div");
    bar.className = k === 2 ? "bar act" : "bar";
    bar.append(document.createElement("i"), ...(k === 2 ? [document.createElement("u")] : []));
    row.insertCell().append(bar);
  }
  return row;
}

function setBar(bar, value, title) {
  const length = 50 * Math.min(1, Math.abs(value));
  bar.firstChild.style.left = `${value < 0 ? 50 - length : 50}%`;
  bar.firstChild.style.width = `${length}%`;
  bar.title = title;
}

const COUNTS = ["human_labels", "expert_labels", "demonstration", "interventions", "calls", "training_steps"];

export function showCounts(list, counts, words) {
  if (counts === null) return list.replaceChildren();
  if (list.children.length !== COUNTS.length) {
    list.replaceChildren(...COUNTS.map((name) => {
      const entry = document.createElement("div");
      entry.append(document.createElement("dd"), document.createElement("dt"));
      entry.lastChild.textContent = words[name];
      return entry;
    }));
  }
  COUNTS.forEach((name, index) => { list.children[index].firstChild.textContent = counts[name]; });
  return undefined;
}

// The learning curve of a session: what share of each lap was driven without the person. Full height is all of it.
export function drawLaps(canvas, shares) {
  const { pen, width, height } = begin(canvas);
  const step = Math.min(28, width / shares.length);
  shares.forEach((share, index) => {
    pen.fillStyle = colour("rule");
    pen.fillRect(index * step, 0, 0.75 * step, height);
    pen.fillStyle = colour("bar");
    pen.fillRect(index * step, height * (1 - share), 0.75 * step, height * share);
  });
}

// Labels over time: a curve that goes flat is a person who is needed less.
export class Curve {
  constructor() { this.points = []; this.due = 0; }

  add({ time, counts }) {
    if (time >= this.due) {
      this.points.push([time, counts.human_labels + counts.demonstration, counts.expert_labels]);
      this.due = time + 1;
      if (this.points.length > 1200) this.points = this.points.filter((_, index) => index % 2);
    }
    return this;
  }

  draw(canvas) {
    const { pen, width, height } = begin(canvas);
    if (this.points.length < 2) return;
    const [start, end] = [this.points[0][0], this.points.at(-1)[0]];
    const most = Math.max(1, ...this.points.map((point) => Math.max(point[1], point[2])));
    for (const [column, style] of [[2, "way"], [1, "bar"]]) {
      path(pen, this.points.map((point) => [((point[0] - start) / (end - start)) * width, height - 2 - (point[column] / most) * (height - 4)]), false);
      Object.assign(pen, { strokeStyle: colour(style), lineWidth: 2 });
      pen.stroke();
    }
  }
}
