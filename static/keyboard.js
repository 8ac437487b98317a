// Keys that drive while they are held, and keys that press. They are caught before the scene, which has some for its camera.

import { isDialogOpen } from "./dialogs.js";

const AXES = {
  KeyW: ["forward", 1],
  KeyS: ["forward", -1],
  KeyQ: ["left", 1],
  KeyE: ["left", -1],
  KeyA: ["turn", 1],
  KeyD: ["turn", -1],
  KeyI: ["forward", 1],
  KeyK: ["forward", -1],
  KeyU: ["left", 1],
  KeyO: ["left", -1],
  KeyJ: ["turn", 1],
  KeyL: ["turn", -1],
};
const PRESSES = {
  KeyH: "zero",
  Space: "push",
  KeyN: "rose",
  KeyP: "pause",
  KeyR: "standUp",
  KeyT: "timeline",
  Comma: "tickBack",
  Period: "tickOn",
  Digit1: "chase",
  Digit2: "front",
  Digit3: "side",
  Digit4: "top",
  Digit5: "free",
};

export class Keyboard {
  /**
   * @param {{onChange: (axes: object) => void, onPress: (action: string) => void}} options
   *   onPress gets "help" or a value of PRESSES.
   */
  constructor({ onChange, onPress }) {
    Object.assign(this, { onChange, onPress, held: new Set() });
    this.attach(window);
  }

  /** Listen to a window: the page's, and the scene's each time it has loaded. */
  attach(target) {
    target.addEventListener("keydown", (event) => this.down(event), { capture: true });
    target.addEventListener("keyup", (event) => this.up(event), { capture: true });
    // The focus may only have gone from the page into the scene, or back.
    target.addEventListener("blur", () => setTimeout(() => document.hasFocus() || this.release()));
  }

  down(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || isTyping(event.target) || isDialogOpen()) return;
    if (event.code === "Space" && event.target.matches?.("button:focus-visible, a, summary")) return;
    if (event.code in AXES) {
      if (!event.repeat || !this.held.has(event.code)) {
        this.held.add(event.code);
        this.report();
      }
    } else if (event.key === "?") {
      this.onPress("help");
    } else if (event.code in PRESSES) {
      if (!event.repeat) this.onPress(PRESSES[event.code]);
    } else return;
    swallow(event);
  }

  up(event) {
    if (event.code === "Space" && !isTyping(event.target) && !event.target.matches?.("button:focus-visible")) swallow(event);
    if (this.held.delete(event.code)) {
      this.report();
      swallow(event);
    }
  }

  release() {
    if (!this.held.size) return;
    this.held.clear();
    this.report();
  }

  report() {
    const axes = { forward: 0, left: 0, turn: 0 };
    for (const code of this.held) {
      const [axis, sign] = AXES[code];
      axes[axis] = Math.max(-1, Math.min(1, axes[axis] + sign)); // two keys for the same
    }
    this.onChange(axes);
  }
}

function isTyping(target) {
  return Boolean(target.matches?.("textarea, select, [contenteditable=true], input:not([type=range], [type=checkbox])"));
}

function swallow(event) {
  event.preventDefault();
  event.stopImmediatePropagation();
}
