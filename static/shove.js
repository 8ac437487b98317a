// The push: its direction relative to the robot on a ring around the button, its strength on a slider.

const KEY_STEP = 15; // degrees
const DIRECTIONS = ["forward", "forward left", "left", "back left", "back", "back right", "right", "forward right"];

export class Shove {
  /** @param {{onPush: (impulse: number[]) => void}} options; the impulse is in the robot's frame, N s */
  constructor({ onPush }) {
    this.onPush = onPush;
    this.degrees = 90; // counter-clockwise from forward: to the left
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
    document.getElementById("push").addEventListener("click", () => this.push());
    this.show();
  }

  limit(strongest) {
    this.strength.max = strongest;
    this.show();
  }

  aim(event) {
    const box = this.ring.getBoundingClientRect();
    const right = event.clientX - box.left - box.width / 2;
    const up = box.top + box.height / 2 - event.clientY;
    this.degrees = Math.round((Math.atan2(-right, up) * 180) / Math.PI / 5) * 5;
    this.show();
  }

  turn(event) {
    const step = { ArrowLeft: KEY_STEP, ArrowUp: KEY_STEP, ArrowRight: -KEY_STEP, ArrowDown: -KEY_STEP }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    this.degrees = ((((this.degrees + step + 180) % 360) + 360) % 360) - 180;
    this.show();
  }

  show() {
    const direction = DIRECTIONS[(Math.round(this.degrees / 45) + 8) % 8];
    const text = `${this.strength.value} N·s`;
    this.dial.style.setProperty("--angle", `${-this.degrees}deg`);
    this.ring.ariaValueNow = this.degrees;
    this.ring.ariaValueText = direction;
    this.strength.ariaValueText = `${this.strength.value} newton seconds`;
    document.getElementById("push-text").textContent = text;
  }

  push() {
    const angle = (this.degrees * Math.PI) / 180;
    const strength = Number(this.strength.value);
    this.onPush([strength * Math.cos(angle), strength * Math.sin(angle)]);
  }
}
