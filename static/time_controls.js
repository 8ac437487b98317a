// Controls of simulated time: pause, single ticks and samples, speed, reset.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const NAMES = { 0.1: "1/10 ×", 0.25: "1/4 ×", 0.5: "1/2 ×" };

export class TimeControls {
  /** @param {{request: (method: string, path: string, body?: object) => Promise<any>}} options */
  constructor({ request }) {
    this.request = request;
    this.isRunning = true;
    this.stop = document.getElementById("stop");
    this.steps = document.getElementById("steps");
    this.speed = document.getElementById("speed");
    this.speed.append(...SPEEDS.map(option));
    this.speed.value = "1";
    this.speed.addEventListener("change", () => this.choose());
    this.stop.addEventListener("click", () => this.toggle());
    for (const [id, body] of [["one-tick", { ticks: 1 }], ["one-sample", { samples: 1 }]]) {
      document.getElementById(id).addEventListener("click", () => request("POST", "live/step", body));
    }
    for (const id of ["reset", "stand-up"]) document.getElementById(id).addEventListener("click", () => this.reset());
  }

  /** Put the robot back to the start, upright. */
  reset() {
    return this.request("POST", "live/reset");
  }

  toggle() {
    return this.request("POST", this.isRunning ? "live/pause" : "live/resume");
  }

  choose() {
    this.request("POST", "live/speed", { factor: Number(this.speed.value) });
    this.speed.blur(); // or the next key, meant for the robot, changes it
  }

  show(live) {
    if (this.isRunning !== live.running) {
      this.isRunning = live.running;
      this.stop.textContent = live.running ? "Pause" : "Resume";
      this.steps.hidden = live.running;
    }
    this.follow(live.speed ?? 1);
  }

  /** Show the speed in force, which another browser or program may have chosen. */
  follow(speed) {
    if (document.activeElement === this.speed) return; // its list is open
    const value = String(speed);
    if (this.speed.value === value) return;
    if (![...this.speed.options].some((known) => known.value === value)) this.speed.append(option(speed));
    this.speed.value = value;
  }
}

function option(speed) {
  return new Option(NAMES[speed] ?? `${speed} ×`, String(speed));
}
