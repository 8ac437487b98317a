// Keys that drive while they are held. They are caught before the scene, whose own are WASD, QE and the arrows.

const AXES = {
  KeyI: ["forward", 1],
  KeyK: ["forward", -1],
  KeyU: ["left", 1],
  KeyO: ["left", -1],
  KeyJ: ["turn", 1],
  KeyL: ["turn", -1],
};

export class Keyboard {
  /** @param {{onChange: (axes: object) => void, onZero: () => void, onPush: () => void}} actions */
  constructor(actions) {
    this.actions = actions;
    this.held = new Set();
    this.attach(window);
    document.addEventListener("visibilitychange", () => this.releaseAll());
  }

  /** Listen to a window: this page's, and the scene's each time it has loaded. */
  attach(target) {
    target.addEventListener("keydown", (event) => this.down(event), { capture: true });
    target.addEventListener("keyup", (event) => this.up(event), { capture: true });
    target.addEventListener("blur", () => this.releaseAll());
  }

  down(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || isTyping(event.target)) return;
    if (event.code === "Space" && event.target.matches?.("button:focus-visible, summary")) return;
    if (event.code in AXES) {
      this.held.add(event.code);
      this.report();
    } else if (event.code === "KeyH") {
      if (!event.repeat) this.actions.onZero();
    } else if (event.code === "Space") {
      if (!event.repeat) this.actions.onPush();
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

  releaseAll() {
    if (!this.held.size) return;
    this.held.clear();
    this.report();
  }

  report() {
    const axes = { forward: 0, left: 0, turn: 0 };
    for (const code of this.held) axes[AXES[code][0]] += AXES[code][1];
    this.actions.onChange(axes);
  }
}

function isTyping(target) {
  return Boolean(target.matches?.("textarea, select, [contenteditable=true], input:not([type=range], [type=checkbox])"));
}

function swallow(event) {
  event.preventDefault();
  event.stopImmediatePropagation();
}
