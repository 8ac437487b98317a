// What joystick, keyboard and gamepad ask for: the one touched last, sent at a steady rate while it is held.

const SIGN_OF_LIFE_PERIOD = 200; // ms
const REST = { forward: 0, left: 0, turn: 0 };

export class Teleop {
  /** @param {{onRefusal: (text: string) => void, onUse: () => void}} options */
  constructor({ onRefusal, onUse }) {
    this.limits = { vx: [0, 0], vy: [0, 0], yaw_rate: [0, 0] };
    this.client = Array.from(crypto.getRandomValues(new Uint8Array(8)), (byte) => byte.toString(16).padStart(2, "0")).join("");
    this.axes = {}; // of each source
    this.held = []; // sources, the one touched last at the end
    this.grip = 0; // grows with each touch: the server gives the robot to the newest
    this.onUse = onUse;
    this.sender = new Worker(new URL(`./sender.js?client=${this.client}`, import.meta.url), { type: "module" });
    this.sender.onmessage = ({ data }) => onRefusal(data);
    setInterval(() => this.sender.postMessage({}), SIGN_OF_LIFE_PERIOD);
  }

  /**
   * A source asks for fractions of the limits, each in [-1, 1]; what it does not name it leaves as it is.
   * An axis that leaves its rest is a touch; a source that was set to zero is heard again from its next touch on.
   */
  set(source, axes) {
    const before = this.axes[source] ?? REST;
    const after = { ...before, ...axes };
    const isTouched = Object.keys(REST).some((axis) => after[axis] && !before[axis]);
    const wasHeld = this.held.includes(source);
    this.axes[source] = after;
    if (!isTouched && !wasHeld) return;
    if (isTouched) {
      this.grip += 1;
      this.onUse();
    }
    if (isTouched || !isHeld(after)) this.held = this.held.filter((other) => other !== source);
    if (isTouched) this.held.push(source);
    this.tell(source);
  }

  /** Of the robot that the server walks; a hand may already hold. */
  learn(limits) {
    this.limits = limits;
    if (this.held.length) this.tell();
  }

  /** Ask the robot to stop, whatever is held. */
  zero() {
    this.held = [];
    this.grip += 1;
    this.tell("button");
  }

  /** Let go of everything: the page can no longer see the hand. */
  release() {
    if (!this.held.length) return;
    const last = this.held.at(-1);
    this.held = [];
    this.tell(last);
  }

  tell(source) {
    const driver = this.held.at(-1) ?? source;
    const message = { reference: this.reference, driver, grip: this.grip };
    this.sender.postMessage({ held: this.held.length ? message : null, message });
  }

  push(impulse) {
    this.sender.postMessage({ message: { push: { impulse, duration: 0.0, frame: "robot" } } });
  }

  get reference() {
    const axes = this.axes[this.held.at(-1)] ?? REST;
    return {
      vx: scaled(axes.forward, this.limits.vx),
      vy: scaled(axes.left, this.limits.vy),
      yaw_rate: scaled(axes.turn, this.limits.yaw_rate),
    };
  }
}

const isHeld = (axes) => Object.values(axes).some(Boolean);

function scaled(fraction, [low, high]) {
  const clamped = Math.max(-1, Math.min(1, fraction));
  return clamped >= 0 ? clamped * high : -clamped * low;
}
