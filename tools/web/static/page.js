// The page: one socket to lira web. What comes is shown (draw.js), what the hands do goes back (hands.js).
import { Curve, Trail, drawFan, drawLaps, drawMap, showActions, showCounts } from "/static/draw.js";
import { Hands } from "/static/hands.js";

const RETRY_MS = 500;
const SILENT_MS = 1000; // without a frame for so long the page says so itself

const at = (selector) => document.querySelector(selector);
const language = (navigator.language || "en").slice(0, 2);
let settings = null;
let socket = null;
let heard = 0;
let loud = "";
let audio = null;
let picture = "";
const trail = new Trail();
const curve = new Curve();

const say = (message) => socket && socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(message));
const hands = new Hands((input) => say({ type: "say", input }), () => say({ type: "stop" }));

function connect() {
  socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/socket`);
  socket.binaryType = "blob";
  socket.onopen = () => say({ type: "speak", language: settings.language });
  socket.onmessage = ({ data }) => (typeof data === "string" ? show(JSON.parse(data)) : showPicture(data));
  socket.onclose = () => {
    hands.leave();
    setTimeout(connect, RETRY_MS);
  };
}

function show(frame) {
  heard = performance.now();
  hands.answer(frame);
  const { words } = settings;
  document.body.dataset.seat = frame.seat;
  tell(frame.urgency, frame.who, frame.why, frame.now);
  at("#pause").textContent = frame.paused ? words.resume : words.pause;
  showSession(frame.session, words);
  at("#drive").textContent = { yours: words.leave, free: words.drive, taken: words.taken, viewer: words.viewer }[frame.seat];
  at("#drive").disabled = frame.seat === "taken" || frame.seat === "viewer";
  at("#verdict").textContent = frame.verdict;
  at("#link").textContent = frame.link_ms === null ? (frame.waiting ? words.waiting : words.no_link) : `${words.link} ${frame.link_ms.toFixed(0)} ms`;
  at("#link").className = frame.link_ms === null && !frame.waiting ? "bad" : "";
  at("#speed").textContent = frame.speed === null ? "" : `${frame.speed[0].toFixed(2)} m/s  ${frame.speed[1].toFixed(2)} rad/s`;
  at("#battery").textContent = frame.battery_v === null ? "" : `${words.battery} ${frame.battery_v.toFixed(1)} V (${(100 * frame.battery_share).toFixed(0)} %)`;
  at("#battery").className = frame.battery_share !== null && frame.battery_share < 0.25 ? "bad" : "";
  at("#pad").textContent = hands.padName ? `${words.pad}: ${hands.padName}` : "";
  at("#lidar").classList.toggle("empty", frame.scan === null);
  if (frame.scan !== null) drawFan(at("#lidar canvas"), frame.scan, settings);
  at("#map").classList.toggle("empty", frame.pose === null);
  if (frame.pose !== null) drawMap(at("#map canvas"), frame.pose, trail.add(frame.pose), settings.floor);
  at("#actions").classList.toggle("empty", frame.actors.length === 0);
  showActions(at("#actions tbody"), frame, words);
  showCounts(at("#taught dl"), frame.counts, words);
  if (frame.session?.curve.length) drawLaps(at("#taught canvas"), frame.session.curve);
  else if (frame.counts !== null) curve.add(frame).draw(at("#taught canvas"));
  offerExperts(frame.actors.filter((actor) => actor.activation !== null).map((actor) => actor.name));
}

// A session of teaching: how it goes, and what its one button asks at this stage.
function showSession(session, words) {
  at("#prove").hidden = at("#undo").hidden = session === null;
  if (session !== null) {
    at("#prove").textContent = { judging: words.passed, verdict: words.finish }[session.stage] || words.prove;
    at("#reset").textContent = session.stage === "judging" ? words.failed : words.reset;
    at("#session").textContent = session.words;
    if (session.layout !== layout) fetchFloor(session.layout);
  } else at("#session").textContent = "";
}

let layout = null; // of the twin, whose boxes are drawn
async function fetchFloor(wanted) {
  layout = wanted;
  const answer = await fetch(`/settings.json?language=${settings.language}&layout=${wanted}`);
  if (answer.ok) settings.floor = (await answer.json()).floor;
}

function tell(urgency, who, why, now) {
  at("#who").textContent = who;
  at("#why").textContent = why;
  at("#now").textContent = now;
  if (urgency === loud) return;
  loud = urgency;
  document.body.dataset.urgency = urgency;
  at("#sign polygon").setAttribute("points", corners(settings.corners[urgency] || 0));
  if (navigator.userActivation?.hasBeenActive && navigator.vibrate && settings.shakes[urgency]) navigator.vibrate(settings.shakes[urgency]);
  if (settings.tones[urgency]) sound(settings.tones[urgency]);
}

function corners(count) {
  const start = { 3: -Math.PI / 2, 4: Math.PI / 4, 8: Math.PI / 8 }[count];
  return Array.from({ length: count }, (_, k) => start + (2 * Math.PI * k) / count)
    .map((angle) => `${50 + 50 * Math.cos(angle)},${50 + 50 * Math.sin(angle)}`).join(" ");
}

function sound(tones) {
  if (!at("#sound").checked) return;
  audio = audio || new AudioContext();
  let start = audio.currentTime + 0.02;
  for (const [pitch, length] of tones) {
    if (pitch > 0) {
      const tone = audio.createOscillator();
      const gain = audio.createGain();
      gain.gain.setValueAtTime(0, start);
      gain.gain.linearRampToValueAtTime(0.3, start + 0.01);
      gain.gain.setValueAtTime(0.3, start + length - 0.01);
      gain.gain.linearRampToValueAtTime(0, start + length);
      tone.frequency.value = pitch;
      tone.connect(gain).connect(audio.destination);
      tone.start(start);
      tone.stop(start + length);
    }
    start += length;
  }
}

let pictured = 0;
function showPicture(blob) {
  const image = at("#camera img");
  const old = picture;
  picture = URL.createObjectURL(blob);
  image.src = picture;
  if (old) URL.revokeObjectURL(old);
  pictured = performance.now();
  document.body.dataset.pictures = Number(document.body.dataset.pictures || 0) + 1;
  at("#camera").classList.remove("empty");
}

let offered = "";
function offerExperts(names) {
  if (names.join() === offered) return;
  offered = names.join();
  at("#experts").replaceChildren(...names.slice(0, 4).map((name, index) => {
    const button = document.createElement("button");
    button.textContent = `${index + 1} ${name}`;
    button.dataset.control = `expert_${index + 1}`;
    return button;
  }));
}

function watch() {
  const now = performance.now();
  if (now - pictured > SILENT_MS) at("#camera").classList.add("empty");
  if (now - heard > SILENT_MS) {
    hands.leave();
    tell("alarm", settings.words.no_link.toUpperCase(), "", settings.words.server_lost);
  }
}

at("#drive").onclick = () => {
  say({ type: "take", sit: document.body.dataset.seat !== "yours" });
  at("#drive").blur(); // the space bar is the dead-man
};
at("#sound").onchange = () => sound([[880, 0.1]]); // a browser makes sound only once it was touched

settings = await (await fetch(`/settings.json?language=${language}`)).json();
document.documentElement.lang = settings.language;
document.title = `lira: ${settings.robot}`;
for (const element of document.querySelectorAll("[data-word]")) element.textContent = settings.words[element.dataset.word];
for (const element of document.querySelectorAll("[data-title]")) element.title = settings.words[element.dataset.title];
for (const element of document.querySelectorAll("[data-label]")) element.setAttribute("aria-label", settings.words[element.dataset.label]);
hands.listen(document);
connect();
setInterval(watch, 250);
