// Who drives, in words above the joystick, and what is asked of the robot, as a ring on it: on every browser.

const HINT = matchMedia("(pointer: coarse)").matches ? "Drag to walk" : "Drag to walk, or hold I";
const OTHERS = { sliders: "the sliders drive", rest: "a program drives" };

export class Helm {
  /** @param {{client: string, limits: object}} teleop whose page this is */
  constructor(teleop) {
    this.teleop = teleop;
    this.section = document.querySelector(".drive");
    this.caption = document.getElementById("driver");
    this.hasDriven = localStorage.getItem("walk.hasDriven") !== null;
  }

  show(live) {
    const who = whose(live, this.teleop.client);
    const words = this.words(live, who);
    this.section.dataset.who = who;
    this.section.classList.toggle("inviting", who === "nobody" && !this.hasDriven);
    if (this.caption.textContent !== words) this.caption.textContent = words;
    const { vx, vy, yaw_rate } = this.teleop.limits;
    this.mark(".joystick", -fraction(live.reference_vy, vy), -fraction(live.reference_vx, vx));
    this.mark(".turn", -fraction(live.reference_yaw_rate, yaw_rate), 0);
  }

  words(live, who) {
    if (who === "nobody") return this.hasDriven ? "nobody drives" : HINT;
    if (who === "you") return `you drive: ${live.driver}`;
    if (who === "other") return `another browser drives: ${live.driver}`;
    return OTHERS[live.driver] ?? `${live.driver} drives`;
  }

  /** The first use takes the hint away, for good. */
  used() {
    this.hasDriven = true;
    localStorage.setItem("walk.hasDriven", "");
  }

  mark(base, x, y) {
    const ghost = this.section.querySelector(`${base} .ghost`);
    ghost.hidden = !x && !y;
    ghost.style.setProperty("--gx", x.toFixed(3));
    ghost.style.setProperty("--gy", y.toFixed(3));
  }
}

function whose(live, client) {
  if (live.driver === "none") return "nobody";
  if (!live.driver_client) return "elsewhere";
  return live.driver_client === client ? "you" : "other";
}

function fraction(value, [low, high]) {
  if (Math.abs(value) < 1e-6) return 0;
  return value > 0 ? value / high : -value / low;
}
