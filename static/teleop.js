// Reference from joystick, keyboard or gamepad: the control touched last drives, and is sent at a steady rate while held.

const HEARTBEAT_PERIOD = 200; // ms
const REST = { forward: 0, left: 0, turn: 0 };

export class Teleop {
  /** @param {{onRefusal: (text: string) => void, onEngage: () => void}} options */
  constructor({ onRefusal, onEngage }) {
    this.limits = { vx: [0, 0], vy: [0, 0], yaw_rate: [0, 0] };
    this.client = Array.from(crypto.getRandomValues(new Uint8Array(8)), (byte) => byte.toString(16).padStart(2, "0")).join("");
    this.axes = {}; // by source
    this.held = []; // sources, the latest at the end
    this.engagement = 0; // number of the current hold: the server follows the newest one of all pages
    this.onEngage = onEngage;
    this.worker = new Worker(new URL(`./teleop_worker.js?client=${this.client}`, import.meta.url), { type: "module" });
    this.worker.onmessage = ({ data }) => onRefusal(data);
    setInterval(() => this.worker?.postMessage({}), HEARTBEAT_PERIOD);
  }

  /** Send nothing any more: this browser may only look. */
  disconnect() {
    this.worker?.terminate();
    this.worker = null;
  }

  /**
   * Set axes of a source as fractions of the limits, each in [-1, 1]; axes that are not named stay as they are.
   * An axis that leaves zero starts a new engagement; a source that was set to zero is followed again from the next on.
   */
  set(source, axes) {
    const before = this.axes[source] ?? REST;
    const after = { ...before, ...axes };
    const isEngaged = Object.keys(REST).some((axis) => after[axis] && !before[axis]);
    const wasHeld = this.held.includes(source);
    this.axes[source] = after;
    if (!isEngaged && !wasHeld) return;
    if (isEngaged) {
      this.engagement += 1;
      this.onEngage();
    }
    if (isEngaged || !isHeld(after)) this.held = this.held.filter((other) => other !== source);
    if (isEngaged) this.held.push(source);
    this.send(source);
  }

  /** Set the limits of the robot; a control may be held already. */
  setLimits(limits) {
    this.limits = limits;
    if (this.held.length) this.send();
  }

  /** Stop the robot, whatever is held. */
  zero() {
    this.held = [];
    this.engagement += 1;
    this.send("button");
  }

  /** Release all controls. */
  release() {
    if (!this.held.length) return;
    const last = this.held.at(-1);
    this.held = [];
    this.send(last);
  }

  send(source) {
    const driver = this.held.at(-1) ?? source;
    const message = { reference: this.reference, driver, engagement: this.engagement };
    this.worker?.postMessage({ held: this.held.length ? message : null, message });
  }

  push(impulse) {
    this.worker?.postMessage({ message: { push: { impulse, duration: 0.0, frame: "robot" } } });
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
