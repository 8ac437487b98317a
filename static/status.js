// Status strip: reference and measured speed, timing, phase, and what is wrong when something is.

const MEAN_OVER = 1.6; // s, two steps: the CoM sways within them
const MIN_SPEED = 0.02; // m/s
const LIMIT_SHOWN_FOR = 1200; // ms at least: a solve or two at the limit would only flicker
const MIN_REAL_TIME_FACTOR = 0.93; // of the chosen speed
const SIDES = ["left", "right"];

const text = (id, value) => {
  const element = document.getElementById(id);
  if (element.textContent !== value) element.textContent = value;
};

export class Status {
  constructor() {
    this.strip = document.querySelector(".strip");
    this.rate = document.getElementById("rate");
    this.alarm = document.getElementById("alarm");
    this.standUp = document.getElementById("stand-up");
    this.history = [];
    this.limitEnds = 0;
  }

  show(live, isPast = false) {
    text("reference", Math.hypot(live.reference_vx, live.reference_vy).toFixed(2));
    const reached = this.reached(live);
    text("reached", reached === null ? "–" : (Math.round(100 * reached) / 100 + 0).toFixed(2)); // + 0: never "-0.00"
    text("phase", phase(live));
    text("tick", live.timing.tick_ms.toFixed(1));
    text("time", clock(live.t));
    text("real-time", live.real_t === undefined ? "" : ` of ${clock(live.real_t)}`);
    text("plant", live.plant === "mujoco" ? "in physics" : "ideal");
    document.getElementById("plant").title = live.plant_reason ?? "";
    text("twin", live.twin_difference ? `twin: ${live.twin_difference}` : "");
    this.showRate(live);
    this.judge(live, isPast);
  }

  /** Show simulated over real time; the server's factor is relative to the chosen speed. */
  showRate({ timing, running, speed = 1 }) {
    text("factor", (speed * timing.real_time_factor).toFixed(2));
    this.rate.classList.toggle("slow", running && timing.real_time_factor < MIN_REAL_TIME_FACTOR);
  }

  /** Mean velocity over two steps, along the reference where there is one [m/s]; null while too little was seen. */
  reached(live) {
    const { history } = this;
    const gap = history.length ? live.t - history.at(-1).t : 0;
    if (gap < 0 || gap > MEAN_OVER) history.length = 0; // a reset, or a browser too busy to read
    history.push({ t: live.t, x: live.com_x, y: live.com_y });
    while (history.length > 2 && live.t - history[1].t >= MEAN_OVER) history.shift();
    const [first, last] = [history[0], history.at(-1)];
    const time = last.t - first.t;
    if (time <= 0) return null;
    const [x, y] = [(last.x - first.x) / time, (last.y - first.y) / time];
    const heading = (live.left_yaw + live.right_yaw) / 2;
    const forward = x * Math.cos(heading) + y * Math.sin(heading);
    const left = y * Math.cos(heading) - x * Math.sin(heading);
    const reference = Math.hypot(live.reference_vx, live.reference_vy);
    if (reference < MIN_SPEED) return Math.hypot(forward, left);
    return (forward * live.reference_vx + left * live.reference_vy) / reference;
  }

  /** @param {boolean} isPast whether it is an earlier tick that only this browser looks at */
  judge(live, isPast) {
    if (isPast) this.set("past", live.status === 2 ? "the past, fallen" : "the past");
    else if (live.fault) this.set("fault", "stopped", `The server stopped the robot: ${live.fault}`);
    else if (live.status === 2) this.set("fallen", "fallen", `Fallen: ${live.reason || "no step can catch the robot"}.`);
    else if (!live.running) this.set("paused", "paused");
    else if (this.isAtLimit(live)) this.set("relaxed", "at its limit", "The planned step no longer suffices; another plan was found", "warn");
    else if (live.phase === 0) this.set("standing", "standing");
    else this.set("walking", "walking");
  }

  get hasFallen() {
    return this.strip.dataset.state === "fallen";
  }

  isAtLimit(live) {
    const now = performance.now();
    if (live.status === 1) this.limitEnds = now + LIMIT_SHOWN_FOR;
    return now < this.limitEnds;
  }

  lost() {
    this.history.length = 0;
    for (const id of ["reference", "reached", "phase", "tick", "factor"]) text(id, "–"); // what was is not what is
    this.set("lost", "no connection", "Connection lost, retrying …");
  }

  set(state, word, message = "", level = "bad") {
    this.strip.dataset.state = state;
    text("state", word);
    this.alarm.dataset.level = level;
    text("alarm-text", message);
    this.standUp.hidden = state !== "fallen";
    this.alarm.hidden = !message;
  }
}

function phase(live) {
  if (live.status === 2) return "–";
  if (live.phase === 0) return "both feet";
  return live.phase === 1 ? "double support" : `${SIDES[live.support_side]} support`;
}

/** Minutes, seconds and tenths. */
function clock(seconds) {
  const minutes = Math.floor(seconds / 60);
  return `${minutes}:${(seconds - 60 * minutes).toFixed(1).padStart(4, "0")}`.replace(":60.0", ":59.9");
}
