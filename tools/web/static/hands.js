// What hands do: a thumb on the stick and one on the dead-man, keys, or a pad that the browser knows. All three say the
// same words. Nothing here decides who drives: lira web does, and lets go when this page is silent, late or away.

const SAY_MS = 40; // three that do not come, and the hand is gone
const PRESS_MS = 1300; // so long a button counts as held that was pressed by Enter, or by a screen reader
const NEVER_PRESSED = ["dead_man", "turbo"]; // who drives holds these
const KEYS = {
  " ": "dead_man", Shift: "turbo", F1: "release", p: "pause", s: "save", r: "reset", v: "prove", u: "undo",
  1: "expert_1", 2: "expert_2", 3: "expert_3", 4: "expert_4",
};
const ARROWS = { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, 1], ArrowRight: [0, -1] };
// The standard mapping of the Gamepad API, with the controls where `lira joystick` has them.
const PAD = {
  4: "dead_man", 5: "turbo", 8: "estop", 16: "estop", 9: "release", 2: "pause", 3: "save", 1: "reset", 0: "prove", 10: "undo",
  12: "expert_1", 15: "expert_2", 13: "expert_3", 14: "expert_4",
};

export class Hands {
  constructor(say, stop) {
    this.say = say;
    this.stop = stop;
    this.seated = false;
    this.seen = 0;
    this.keys = new Set();
    this.touched = new Map(); // pointer -> control
    this.stick = null; // [forward, turn] under a finger
    this.padName = "";
    this.stopHeld = false;
  }

  listen(page) {
    page.addEventListener("keydown", (event) => this.key(event, true));
    page.addEventListener("keyup", (event) => this.key(event, false));
    page.addEventListener("pointerdown", (event) => this.press(event));
    page.addEventListener("pointermove", (event) => this.move(event));
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      page.addEventListener(end, (event) => this.lift(event));
    }
    page.addEventListener("click", (event) => this.click(event));
    page.addEventListener("contextmenu", (event) => event.target.closest("footer") && event.preventDefault());
    for (const away of ["blur", "pagehide", "freeze"]) window.addEventListener(away, () => this.away());
    page.addEventListener("visibilitychange", () => page.hidden && this.away());
    setInterval(() => this.speak(), SAY_MS);
  }

  answer(frame) {
    this.seen = frame.time;
    this.seated = frame.seat === "yours";
  }

  leave() {
    this.seated = false;
    this.release();
  }

  // Gone from sight: say so at once, since the timers of a hidden page may stop before the next word.
  away() {
    this.release();
    if (this.seated) this.say({ seen: this.seen, away: true });
  }

  release() {
    this.keys.clear();
    this.touched.clear();
    this.stick = null;
    this.show();
  }

  key(event, down) {
    if (event.key === "Escape" && down) {
      if (!event.repeat) this.stop();
      return;
    }
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (!(name in KEYS) && !(name in ARROWS)) return;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (this.seated) event.preventDefault();
    if (down) this.keys.add(name);
    else this.keys.delete(name);
    this.speak();
  }

  // Pressed without a pointer: by Enter on a button that has the focus, or by what a screen reader offers.
  click(event) {
    if (event.detail !== 0) return;
    if (event.target.closest("#stop")) this.stop();
    const control = event.target.closest("[data-control]")?.dataset.control;
    if (!control || NEVER_PRESSED.includes(control)) return;
    const pressed = Symbol(control);
    this.touched.set(pressed, control);
    setTimeout(() => this.lift({ pointerId: pressed }), PRESS_MS);
    this.show();
    this.speak();
  }

  press(event) {
    if (event.target.closest("#stop")) {
      this.stop();
      return;
    }
    const stick = event.target.closest("#stick");
    const button = event.target.closest("[data-control]");
    if (stick) {
      stick.setPointerCapture(event.pointerId);
      this.touched.set(event.pointerId, "stick");
      this.move(event);
    } else if (button) {
      button.setPointerCapture(event.pointerId);
      this.touched.set(event.pointerId, button.dataset.control);
    }
    this.show();
    this.speak();
  }

  move(event) {
    if (this.touched.get(event.pointerId) !== "stick") return;
    const box = document.querySelector("#stick").getBoundingClientRect();
    const reach = Math.min(box.width, box.height) / 2;
    const clip = (value) => Math.min(1, Math.max(-1, value));
    this.stick = [
      clip((box.top + box.height / 2 - event.clientY) / reach),
      clip((box.left + box.width / 2 - event.clientX) / reach),
    ];
    this.show();
  }

  lift(event) {
    if (this.touched.get(event.pointerId) === "stick") this.stick = null;
    this.touched.delete(event.pointerId);
    this.show();
    this.speak();
  }

  pad() {
    const pads = [...(navigator.getGamepads ? navigator.getGamepads() : [])];
    const pad = pads.find((each) => each && each.connected && each.mapping === "standard");
    this.padName = pad ? pad.id.replace(/\s*\(.*/, "") : "";
    return pad;
  }

  speak() {
    const pad = this.pad();
    const held = new Set([...this.keys].map((key) => KEYS[key]).filter(Boolean));
    for (const control of this.touched.values()) if (control !== "stick") held.add(control);
    let [forward, turn] = this.stick || [0, 0];
    for (const key of this.keys) {
      if (key in ARROWS) {
        forward += ARROWS[key][0];
        turn += ARROWS[key][1];
      }
    }
    if (pad) {
      for (const [index, control] of Object.entries(PAD)) if (pad.buttons[index]?.pressed) held.add(control);
      forward -= pad.axes[1];
      turn -= pad.axes[0];
    }
    // A pad's stop reaches the robot also without the seat, as Esc and the button do.
    const stopping = held.delete("estop");
    if (stopping && !this.stopHeld) this.stop();
    this.stopHeld = stopping;
    if (!this.seated || document.hidden) return;
    const clip = (value) => Math.min(1, Math.max(-1, value));
    this.say({ seen: this.seen, forward: clip(forward), turn: clip(turn), held: [...held] });
  }

  show() {
    const on = new Set(this.touched.values());
    for (const button of document.querySelectorAll("[data-control]")) button.classList.toggle("held", on.has(button.dataset.control));
    const thumb = document.querySelector("#stick span");
    const [forward, turn] = this.stick || [0, 0];
    thumb.style.left = `${50 - 38 * turn}%`;
    thumb.style.top = `${50 - 38 * forward}%`;
  }
}
