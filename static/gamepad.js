// A gamepad, polled: any that is plugged in, at any time. Sticks drive, buttons push, stop and pause.

const PERIOD = 33; // ms
const MOVED = 0.5; // of the travel of a stick, by which an axis is recognised
const KEY = "walk.gamepad";

export const AXES = { forward: "forward", left: "to the left", turn: "turn left" };
export const BUTTONS = { push: "push", zero: "zero", pause: "pause, go on", standUp: "stand up", view: "next view" };
export const DEFAULTS = {
  deadzone: 0.12,
  forward: { axis: 1, sign: -1 },
  left: { axis: 0, sign: -1 },
  turn: { axis: 2, sign: -1 },
  push: 0,
  zero: 1,
  pause: 9,
  standUp: 2,
  view: 3,
};

/** Reason why there can be no gamepad here; empty where there can. */
export const obstacle =
  !window.isSecureContext
    ? `Browsers give gamepads only to pages from https or from this very machine. Open the page as http://localhost:${location.port || 80} on the machine that serves it, or put https in front.`
    : !navigator.getGamepads
      ? "This browser has no gamepads."
      : "";

export class Gamepads {
  /**
   * @param {{onChange: (axes: object) => void, onPress: (action: string) => void, onPlug: (pad: Gamepad | null) => void}} options
   *   onPress gets a key of BUTTONS; onPlug gets null when the last pad is gone.
   */
  constructor(options) {
    Object.assign(this, options, { id: null, pressed: [], axes: "", isSuspended: false, settings: remembered(null) });
    if (!obstacle) setInterval(() => this.poll(), PERIOD);
  }

  /** The first pad that is connected. */
  get pad() {
    return obstacle ? null : (navigator.getGamepads().find((pad) => pad?.connected) ?? null);
  }

  poll() {
    const { pad } = this;
    if ((pad?.id ?? null) !== this.id) this.plug(pad);
    if (!pad) return;
    const pressed = pad.buttons.map((button) => button.pressed);
    const isHeard = !this.isSuspended && !document.hidden;
    const axes = isHeard ? this.read(pad) : { forward: 0, left: 0, turn: 0 };
    if (isHeard) {
      for (const action of Object.keys(BUTTONS)) {
        const button = this.settings[action];
        if (pressed[button] && !this.pressed[button]) this.onPress(action);
      }
    }
    this.pressed = pressed;
    const text = JSON.stringify(axes);
    if (text !== this.axes) this.onChange(axes);
    this.axes = text;
  }

  plug(pad) {
    this.id = pad?.id ?? null;
    this.settings = remembered(this.id);
    this.pressed = pad?.buttons.map((button) => button.pressed) ?? [];
    if (!pad) this.onChange({ forward: 0, left: 0, turn: 0 });
    this.axes = "";
    this.onPlug(pad);
  }

  /** Axes as fractions of the limits: zero within the dead zone, and from its edge on the share of the remaining travel. */
  read(pad) {
    const value = ({ axis, sign }) => sign * (pad.axes[axis] ?? 0);
    const { forward, left, turn, deadzone } = this.settings;
    const [x, y] = beyond(deadzone, value(forward), value(left));
    return { forward: x, left: y, turn: beyond(deadzone, value(turn), 0)[0] };
  }

  change(values) {
    this.settings = { ...this.settings, ...values };
    localStorage.setItem(KEY, JSON.stringify({ ...stored(), [this.id]: this.settings }));
  }
}

/** Axis that has moved most from its rest, with its sign; null while none has moved far. */
export function movedAxis(pad, rest) {
  const moves = pad.axes.map((value, axis) => value - (rest[axis] ?? 0));
  const axis = moves.reduce((most, move, i) => (Math.abs(move) > Math.abs(moves[most]) ? i : most), 0);
  return Math.abs(moves[axis] ?? 0) < MOVED ? null : { axis, sign: Math.sign(moves[axis]) };
}

function beyond(deadzone, x, y) {
  const length = Math.hypot(x, y);
  if (length <= deadzone) return [0, 0];
  const scale = Math.min(1, (length - deadzone) / (1 - deadzone)) / length;
  return [x, y].map((value) => Math.round(value * scale * 200) / 200 + 0); // steps of 0.005, never -0
}

function stored() {
  try {
    return JSON.parse(localStorage.getItem(KEY)) ?? {};
  } catch {
    return {}; // not written by this page
  }
}

const remembered = (id) => ({ ...DEFAULTS, ...stored()[id] });
