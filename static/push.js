// Pushes: the dial that aims one, the report of the last one, and random pushes.

import { onTap } from "./joystick.js";

const KEY_STEP = 15; // degrees
const DIRECTIONS = ["forward", "forward left", "left", "back left", "back", "back right", "right", "forward right"];
const HINT = "Aim the ring, then push";
const FINE = 10; // N s, strongest push of a robot so light that its pushes need tenths
const INTERVAL = 4; // s between random pushes, in the mean

/** Direction on a ring, which shows the picture's directions, around the button, strength on a slider. */
export class PushDial {
  /** @param {{onPush: (impulse: number[]) => void}} options; the impulse is in the robot's frame, N s */
  constructor({ onPush }) {
    this.onPush = onPush;
    this.degrees = 90; // counter-clockwise from the robot's forward: to the left
    this.front = 0; // degrees on the screen at which the robot faces, counter-clockwise from up
    this.dial = document.getElementById("dial");
    this.ring = document.getElementById("ring");
    this.strength = document.getElementById("strength");
    this.ring.addEventListener("pointerdown", (event) => {
      this.ring.setPointerCapture(event.pointerId);
      this.aim(event);
    });
    this.ring.addEventListener("pointermove", (event) => {
      if (this.ring.hasPointerCapture(event.pointerId)) this.aim(event);
    });
    this.ring.addEventListener("keydown", (event) => this.turn(event));
    this.strength.addEventListener("input", () => this.show());
    onTap(document.getElementById("push"), () => this.push());
    this.show();
  }

  /** Take the strongest push of a robot, N s; the slider stays at the same share of it. */
  setLimit(maxImpulse) {
    const { strength } = this;
    const share = strength.value / strength.max;
    strength.step = maxImpulse < FINE ? 0.1 : 1;
    strength.max = maxImpulse;
    strength.min = Math.max(strength.step, Math.round(maxImpulse / 30));
    strength.value = share * maxImpulse;
    this.show();
  }

  /** @param {number} angle on the screen at which the robot faces, counter-clockwise from up, rad */
  setFront(angle) {
    this.front = (angle * 180) / Math.PI;
    this.show();
  }

  aim(event) {
    const box = this.ring.getBoundingClientRect();
    const right = event.clientX - box.left - box.width / 2;
    const up = box.top + box.height / 2 - event.clientY;
    this.degrees = within(Math.round(((Math.atan2(-right, up) * 180) / Math.PI - this.front) / 5) * 5);
    this.show();
  }

  turn(event) {
    const step = { ArrowLeft: KEY_STEP, ArrowUp: KEY_STEP, ArrowRight: -KEY_STEP, ArrowDown: -KEY_STEP }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    this.degrees = within(this.degrees + step);
    this.show();
  }

  show() {
    const direction = DIRECTIONS[(Math.round(this.degrees / 45) + 8) % 8];
    const text = `${this.strength.value} N·s`;
    this.dial.style.setProperty("--angle", `${-this.degrees - this.front}deg`);
    this.ring.ariaValueNow = this.degrees;
    this.ring.ariaValueText = direction;
    this.strength.ariaValueText = `${this.strength.value} newton seconds`;
    document.getElementById("push-text").textContent = text;
  }

  /** The impulse that the ring is set to, in the robot's frame, N s. */
  get impulse() {
    const angle = (this.degrees * Math.PI) / 180;
    const strength = Number(this.strength.value);
    return [strength * Math.cos(angle), strength * Math.sin(angle)];
  }

  push() {
    this.onPush(this.impulse);
  }
}

const WORDS = ["", "one", "two", "three", "four", "five", "six"];
/** An angle in degrees from -180 on, below 180. */
const within = (degrees) => ((((degrees + 180) % 360) + 360) % 360) - 180;

/** Outcome of the last push, above the dial. */
export class PushReport {
  constructor() {
    this.caption = document.getElementById("last-push");
    this.hasPushed = localStorage.getItem("walk.hasPushed") !== null;
  }

  show(live) {
    const words = live.last_push ? outcome(live.last_push) : this.hasPushed ? "" : HINT;
    if (this.caption.textContent !== words) this.caption.textContent = words;
    this.caption.dataset.outcome = live.last_push?.survived === false ? "bad" : "";
    this.caption.classList.toggle("hint", words === HINT);
  }

  /** Remove the hint, for good: this person has pushed. */
  dismissHint() {
    this.hasPushed = true;
    localStorage.setItem("walk.hasPushed", "");
  }
}

/** The button that draws the rose of pushes in this browser, and in words how hard a push along the ring would be survived. */
export class PushRose {
  /** @param {{dial: PushDial, client: string, request: (method: string, path: string, body?: object) => Promise<any>}} options */
  constructor({ dial, client, request }) {
    Object.assign(this, { dial, request, path: `live/layers?client=${client}`, hadRose: null, asked: 0 });
    this.caption = document.getElementById("push-limit");
    this.button = document.getElementById("rose");
    this.button.addEventListener("click", () => this.toggle());
  }

  get isOn() {
    return this.button.ariaPressed === "true";
  }

  async toggle() {
    const isOn = !this.isOn;
    this.button.ariaPressed = String(isOn); // before the answer, so that a second press switches back
    const isTaken = await this.take(this.request("PATCH", this.path, { push_rose: isOn }));
    if (!isTaken) this.update(); // a refusal is on the screen already
  }

  /** Ask whether this browser draws it: the panel and links switch it, too. */
  update() {
    this.take(this.request("GET", this.path));
  }

  async take(layers) {
    const asked = ++this.asked;
    const isOn = (await layers)?.push_rose;
    if (isOn !== undefined && asked === this.asked) this.button.ariaPressed = String(isOn);
    return isOn !== undefined;
  }

  show({ push_rose: rose, status }) {
    const hasRose = Boolean(rose);
    if (hasRose !== this.hadRose) this.update();
    this.hadRose = hasRose;
    const words = this.isOn && rose && status !== 2 ? this.words(rose) : "";
    if (this.caption.textContent !== words) this.caption.textContent = words;
    this.caption.dataset.outcome = words.startsWith("too hard") ? "bad" : "";
  }

  words(rose) {
    const { degrees, strength } = this.dial;
    const survived = inDirection(rose.survived, degrees);
    if (survived >= strength.max) return `survives all of ${strength.max} N·s from here`;
    const most = Math.max(survived, inDirection(rose.bound, degrees));
    const [rounded, bound] = [survived, most].map((impulse) => impulse.toFixed(strength.step < 1 ? 1 : 0));
    const limit = `survives ${rounded} of ${bound} N·s from here`;
    return Number(strength.value) > survived ? `too hard: ${limit}` : limit;
  }
}

/** Value between those of evenly spaced directions, the first straight ahead, counter-clockwise. */
function inDirection(values, degrees) {
  const at = (within(degrees) / 360 + 1) * values.length;
  const [before, after] = [Math.floor(at), Math.floor(at) + 1].map((k) => values[k % values.length]);
  return before + (at % 1) * (after - before);
}

function outcome({ impulse, survived, steps, shortened }) {
  const strength = `${Math.hypot(...impulse).toFixed(0)} N·s`;
  if (survived === null) return `${strength}: catching itself …`;
  if (!survived) return `fell to ${strength}`;
  if (!steps) return `${strength}: caught without a step`;
  return `${strength}: caught in ${count(steps, "step")}${hurried(shortened ?? [])}`;
}

/** The steps that were shortened, in words: ", two shortened to 0.5 s". */
function hurried(durations) {
  if (!durations.length) return "";
  const [shortest, longest] = [Math.min(...durations), Math.max(...durations)].map((s) => `${Number(s.toFixed(2))}`);
  const to = shortest === longest ? shortest : `${shortest} to ${longest}`;
  return `, ${WORDS[durations.length] ?? durations.length} shortened to ${to} s`;
}

function count(n, noun) {
  return `${n} ${noun}${n === 1 ? "" : "s"}`;
}

/** Random pushes as a mode: switched here, given by the server, shown on every browser. */
export class RandomPushes {
  /** @param {{request: (method: string, path: string, body?: object) => Promise<any>}} options */
  constructor({ request }) {
    this.request = request;
    this.button = document.getElementById("random");
    this.strength = document.getElementById("strength");
    this.button.addEventListener("click", () => this.set(!this.isOn));
    this.strength.addEventListener("change", () => this.isOn && this.set(true));
  }

  get isOn() {
    return this.button.ariaPressed === "true";
  }

  set(isOn) {
    const body = isOn ? { strength: Number(this.strength.value), interval: INTERVAL } : { strength: 0 };
    this.request("PUT", "live/random-pushes", body);
  }

  show(live) {
    const isOn = String((live.random_pushes?.strength ?? 0) > 0);
    if (this.button.ariaPressed !== isOn) this.button.ariaPressed = isOn;
  }
}
