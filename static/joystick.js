// Joystick: a knob that follows mouse or finger within its base and springs back; two axes, or one for turning.

const DEAD_ZONE = 0.06; // of the travel

/** Let a button act beside a stick that is held: of fingers at the same time only the first one's tap is a click. */
export function onTap(button, act) {
  button.addEventListener("click", act);
  button.addEventListener("pointerdown", ({ isPrimary }) => isPrimary || button.disabled || act());
}

export class Joystick {
  /**
   * @param {HTMLElement} base with a `.knob` in it
   * @param {{isOneAxis?: boolean, onChange: (x: number, y: number) => void}} options
   *   onChange gets x to the right and y upwards, in [-1, 1].
   */
  constructor(base, { isOneAxis = false, onChange }) {
    Object.assign(this, { base, isOneAxis, onChange, pointer: null });
    base.addEventListener("pointerdown", (event) => this.press(event));
    base.addEventListener("pointermove", (event) => this.follow(event));
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) {
      base.addEventListener(type, (event) => event.pointerId === this.pointer && this.release());
    }
    base.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  press(event) {
    if (this.pointer !== null || event.button !== 0 || this.base.ariaDisabled === "true") return;
    this.pointer = event.pointerId;
    this.base.setPointerCapture(event.pointerId);
    this.base.classList.add("held");
    this.follow(event);
  }

  follow(event) {
    if (event.pointerId !== this.pointer) return;
    const box = this.base.getBoundingClientRect();
    const knob = this.base.querySelector(".knob").offsetWidth;
    const travel = (box.width - knob) / 2;
    let x = (event.clientX - box.left - box.width / 2) / travel;
    let y = this.isOneAxis ? 0 : (box.top + box.height / 2 - event.clientY) / travel;
    const length = Math.hypot(x, y);
    if (length > 1) [x, y] = [x / length, y / length];
    this.place(x * travel, -y * travel);
    this.onChange(...(length < DEAD_ZONE ? [0, 0] : [x, y]));
  }

  release() {
    if (this.pointer === null) return;
    this.pointer = null;
    this.base.classList.remove("held");
    this.place(0, 0);
    this.onChange(0, 0);
  }

  place(x, y) {
    this.base.style.setProperty("--x", `${x}px`);
    this.base.style.setProperty("--y", `${y}px`);
  }
}
