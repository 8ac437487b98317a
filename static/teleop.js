// What joystick and keyboard ask for together: sent at a steady rate while held, and zero when let go.

const SIGN_OF_LIFE_PERIOD = 200; // ms
const AXES = ["forward", "left", "turn"];

export class Teleop {
  constructor() {
    this.limits = { vx: [0, 0], vy: [0, 0], yaw_rate: [0, 0] };
    this.sources = {};
    this.sender = new Worker(new URL("./sender.js", import.meta.url), { type: "module" });
    setInterval(() => this.sender.postMessage({}), SIGN_OF_LIFE_PERIOD);
  }

  /** A source asks for a fraction of the limits along `forward`, `left` and `turn`, each in [-1, 1]. */
  set(source, axes) {
    const wasHeld = this.isHeld;
    this.sources[source] = axes;
    if (!this.isHeld && !wasHeld) return;
    const message = { reference: this.reference };
    this.sender.postMessage({ held: this.isHeld ? message : null, message });
  }

  push(impulse) {
    this.sender.postMessage({ message: { push: { impulse, duration: 0.0, frame: "robot" } } });
  }

  get isHeld() {
    return Object.values(this.sources).some((axes) => AXES.some((axis) => axes[axis]));
  }

  get reference() {
    const sum = (axis) => Object.values(this.sources).reduce((total, axes) => total + (axes[axis] ?? 0), 0);
    return {
      vx: scaled(sum("forward"), this.limits.vx),
      vy: scaled(sum("left"), this.limits.vy),
      yaw_rate: scaled(sum("turn"), this.limits.yaw_rate),
    };
  }
}

function scaled(fraction, [low, high]) {
  const clamped = Math.max(-1, Math.min(1, fraction));
  return clamped >= 0 ? clamped * high : -clamped * low;
}
