// The active driver in words above the joystick, and the reference as a ring on it: on every browser.

const HINT = matchMedia("(pointer: coarse)").matches ? "Drag to walk" : "Drag to walk, or hold W";
const WITHOUT_PAGE = { sliders: "the sliders drive", rest: "a program drives", past: "as it was, until somebody drives" };

export class DriverDisplay {
  /** @param {{client: string, limits: object}} teleop of this page */
  constructor(teleop) {
    this.teleop = teleop;
    this.section = document.querySelector(".drive");
    this.caption = document.getElementById("driver");
    this.front = 0;
    this.hasDriven = localStorage.getItem("walk.hasDriven") !== null;
  }

  /** @param {"operator" | "viewer"} role of this browser */
  setRole(role) {
    this.onlyLooks = role === "viewer";
  }

  /** @param {number} angle on the screen at which the robot faces, counter-clockwise from up, rad */
  setFront(angle) {
    this.front = angle;
  }

  show(live) {
    const place = placeOf(live, this.teleop.client);
    const words = this.words(live, place);
    this.section.dataset.driver = place;
    this.section.classList.toggle("inviting", place === "nowhere" && !this.hasDriven && !this.onlyLooks);
    if (this.caption.textContent !== words) this.caption.textContent = words;
    const { vx, vy, yaw_rate } = this.teleop.limits;
    const [forward, left] = [fraction(live.reference_vx, vx), fraction(live.reference_vy, vy)];
    const [sin, cos] = [Math.sin(this.front), Math.cos(this.front)];
    this.mark(".joystick", -left * cos - forward * sin, left * sin - forward * cos);
    this.mark(".turn", -fraction(live.reference_yaw_rate, yaw_rate), 0);
  }

  words(live, place) {
    if (this.onlyLooks) return `you are watching${place === "nowhere" ? "" : `: ${live.driver} drives`}`;
    if (place === "nowhere") return this.hasDriven ? "nobody drives" : HINT;
    if (place === "here") return `you drive: ${live.driver}`;
    if (place === "elsewhere") return `another browser drives: ${live.driver}`;
    return WITHOUT_PAGE[live.driver] ?? `${live.driver} drives`;
  }

  /** Remove the hint, for good: this person has driven. */
  dismissHint() {
    this.hasDriven = true;
    localStorage.setItem("walk.hasDriven", "");
  }

  /** Show a reference on a control, as fractions of its travel in [-1, 1], x to the right and y downwards. */
  mark(control, x, y) {
    const mark = this.section.querySelector(`${control} .reference`);
    mark.hidden = !x && !y;
    mark.style.setProperty("--rx", x.toFixed(3));
    mark.style.setProperty("--ry", y.toFixed(3));
  }
}

/** @returns {"nowhere" | "here" | "elsewhere" | "program"} where the active driver is, seen from this page */
function placeOf(live, client) {
  if (live.driver === "none") return "nowhere";
  if (!live.driver_client) return "program";
  return live.driver_client === client ? "here" : "elsewhere";
}

/** Value as a fraction of its limit. */
function fraction(value, [low, high]) {
  if (Math.abs(value) < 1e-6) return 0;
  return value > 0 ? value / high : -value / low;
}
